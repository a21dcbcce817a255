// libavdevice's reader of cameras on V4L2 devices.
#pragma once

struct AVInputFormat;

namespace kiroku::recorder {

/// For avformat_open_input(). The first call loads libavdevice, and with it some fifty libraries of screens
/// and sound servers that nothing else here needs: programs that open no such camera start without them, and
/// a decoder's box holds none of their code. Throws kiroku::Error where libavdevice is missing or has no
/// V4L2. Thread-safe.
const AVInputFormat* v4l2_input_format();

}  // namespace kiroku::recorder
