"""The documentation site: pages that are generated at build time, and checks of what pages name."""
