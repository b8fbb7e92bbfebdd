"""Models of a contact, the choice between them, and what they are asked."""
