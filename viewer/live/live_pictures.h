// Live pictures for the viewer's server: a WebSocket each stream (docs/reference/viewer.md, "Live").
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>

#include "viewer/live/live_channel.h"
#include "viewer/rooms/live_pictures.h"

namespace kiroku::live {

/// By room and stream.
using Channels = std::map<std::pair<std::string, std::string>, std::unique_ptr<LiveChannel>>;

/// `channels` must not change any more and outlive the server.
viewer::LivePictures live_pictures(const Channels& channels);

}  // namespace kiroku::live
