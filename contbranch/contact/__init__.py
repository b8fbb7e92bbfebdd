"""What is in contact: tip, interaction law, modulus and units; contact files, height maps, families of contacts."""

from contbranch.contact.contact import Contact

__all__ = ["Contact"]
