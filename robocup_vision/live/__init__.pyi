from .handover.page_settings import FeedSettings
from .viewer import Viewer

__all__ = ["FeedSettings", "Viewer"]
