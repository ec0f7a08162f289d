"""Properties that any element, material or scene must have before it is planned on."""
