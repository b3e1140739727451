"""Fields under the library's own name: `load_field` and `Field` are defined in `field_models`."""

from field_models.catalog import field_names, load_field
from field_models.field import Field

__all__ = ["Field", "field_names", "load_field"]
