"""What tests share: small courses, served races, browsers, quick trainings."""
