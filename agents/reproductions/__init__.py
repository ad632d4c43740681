"""Reproductions of tables of published reports, beside their own figures."""
