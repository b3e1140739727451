from .call_writer import RecorderSettings
from .recorder import Recorder
from .recording import RecordedFrame, Recording

__all__ = ["RecordedFrame", "Recorder", "RecorderSettings", "Recording"]
