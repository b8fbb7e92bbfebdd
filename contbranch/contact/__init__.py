"""What is in contact: tip, interaction law, modulus and units; contact files, height maps, families of contacts."""

from typing import TYPE_CHECKING

from contbranch._lazy import lazily

if TYPE_CHECKING:
    from contbranch.contact.contact import Contact as Contact

__getattr__, __dir__, __all__ = lazily(__name__, {".contact": "Contact"})
