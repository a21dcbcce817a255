// How the two ends of a viewing box (viewing_boxes.h) write things down. Pure functions; thread-safe.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "viewer/playback/case_media.h"
#include "viewer/playback/sound_reader.h"
#include "viewer/playback/viewing_format.h"

namespace kiroku::playback {

// Names of jobs, and what they are asked with and answer.
inline constexpr const char* kIndexJob = "index";             // json_of(VideoIndex); {}
inline constexpr const char* kFormatJob = "format";           // {}; json_of(ViewingFormat)
inline constexpr const char* kPieceJob = "piece";             // {"format", "number"}; {} and bytes
inline constexpr const char* kSoundJob = "sound";             // {}; {} or {"form"}
inline constexpr const char* kSoundPieceJob = "sound-piece";  // {"form", "number"}; {} and bytes
inline constexpr const char* kThumbnailJob = "thumbnail";     // {"number"}; {} and bytes
inline constexpr const char* kStillJob = "still";  // {"at_ns", "step"}; {} or {"time_ns"} and bytes
// The pictures of a part, one after the other: where it begins, then each (picture_span.h). Times are ticks.
// "from": the last key frame before it comes first; "after": the first picture after it does, and that one is
// the one before.
inline constexpr const char* kSpanJob = "span";           // {"from", "after", "stop"}, each may be null; {}
inline constexpr const char* kSpanNextJob = "span-next";  // {}; {} or {"time", "width", "height"}
inline constexpr const char* kSpanPixelsJob = "span-pixels";  // {"before", "width", "height"}; {} and bytes

// What readers use of an index, and no more. Reading throws nlohmann::json::exception or kiroku::Error for
// what cannot be: the box may say anything.
nlohmann::json json_of(const VideoIndex& index);
VideoIndex index_from(const nlohmann::json& json);
nlohmann::json json_of(const ViewingFormat& format);
ViewingFormat format_from(const nlohmann::json& json);
nlohmann::json json_of(const SoundForm& form);
SoundForm sound_form_from(const nlohmann::json& json);

}  // namespace kiroku::playback
