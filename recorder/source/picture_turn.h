// How a film says that its pictures are to be shown, turned or mirrored, and pictures turned so: samples
// change their places and nothing else. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "media/libav_handles.h"

namespace kiroku::recorder {

enum class Turn : std::uint8_t {
  kNone,
  kClockwise,
  kHalf,
  kAnticlockwise,
  kMirrored,    // left and right change places
  kUpsideDown,  // above and below do
  kTransposed,  // mirrored about the diagonal from the left upper corner
  kTransversed,
  kOther,  // no permutation of pixels: by other angles, sheared
};
inline constexpr Turn kLastTurn = Turn::kOther;

/// Of the nine numbers of a display matrix (ISO 14496-12, 8.5.2; H.264 has one as its display orientation).
Turn turn_of(const std::int32_t* matrix);
/// What the frame itself says. A coded stream says it for the pictures that follow, too, until one that
/// begins anew, and libavcodec hands it out with the first alone: else `before`, which is the one of the
/// picture before, and of a key frame `of_stream`.
Turn turn_of(const AVFrame& frame, Turn of_stream, std::optional<Turn> before = {});

/// Whether turned() loses nothing: not of samples that stand for pixels side by side in one direction alone,
/// and of interlaced pictures only left and right change places without mixing their fields.
bool can_turn(const AVFrame& frame, Turn turn);
/// can_turn() must hold. Times and colours are the same; what said that it must be turned is gone.
media::Frame turned(const AVFrame& frame, Turn turn);

enum class FieldOrder : std::uint8_t { kProgressive, kUpperFirst, kLowerFirst };
FieldOrder field_order_of(const AVFrame& frame);

/// What the pictures of a source were like before they were recorded.
struct PictureTreatment {
  Turn turn = Turn::kNone;  // that they state
  bool is_turned = false;   // else they are recorded as they are coded
  FieldOrder fields = FieldOrder::kProgressive;
};
bool are_shown_alike(const PictureTreatment& one, const PictureTreatment& other);
/// "its pictures are turned by 90 degrees clockwise, as it says that they are shown"; "" where it says
/// nothing.
std::string turn_text(const PictureTreatment& treatment);
/// What the ledger says behind the source's address: "; …", or "".
std::string ledger_text(const PictureTreatment& treatment);

}  // namespace kiroku::recorder
