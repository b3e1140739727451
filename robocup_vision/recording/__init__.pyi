from .recorder import Recorder, RecorderSettings
from .recording import RecordedFrame, Recording

__all__ = ["RecordedFrame", "Recorder", "RecorderSettings", "Recording"]
