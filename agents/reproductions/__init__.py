"""Tables of the reports, made again here: what is trained, how it is measured, what they found."""
