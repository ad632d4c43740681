"""Written by flatc from `schemas/`; do not edit."""
