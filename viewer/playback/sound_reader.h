// The archived sound of a stream as samples on the case clock. An object belongs to one thread; functions are
// thread-safe.
//
// Which sample is when. A recorder codes the sound of a stream as one unbroken row of blocks over the whole
// case (recorder/encoder/sound_encoder.h), but a container states a block's time in its own unit only: 1 ms
// in Matroska. So the time of one block gives the place of the row, and every other block has its place in
// it: whatever part of a stream is read, from whichever segment on, samples stand where they stand when all
// of it is read at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "media/libav_handles.h"
#include "viewer/playback/case_media.h"

namespace kiroku::playback {

/// What a stream's archived sound is like. A value.
struct SoundForm {
  int rate = 0, channels = 0;
  /// Samples of a block, and where blocks begin: at whole multiples of it from here.
  std::int64_t block = 0, origin = 0;

  /// The sample, counted from the case clock's zero, that a block with this time begins with.
  [[nodiscard]] std::int64_t place_of(Ticks time) const;
};

/// Nothing for a stream without sound: told by its last whole segment, since the recorder never gives up a
/// track of sound that it began. Throws as SegmentPackets where none of the last segments can be read.
std::optional<SoundForm> find_sound(const SegmentOpener& media, const VideoIndex& index);

/// What read() looks at lies no further away than this: sound goes its own way through the recorder, and may
/// stand in the segment before or after that of its time.
inline constexpr Ticks kSoundReach = kTicksPerSecond;

class SoundReader {
 public:
  /// The first two must outlive the object.
  SoundReader(const SegmentOpener& media, const VideoIndex& index, const SoundForm& form);

  /// Samples [from, to) of the case clock at the archive's own rate, 16 bit, channels interleaved
  /// ((to - from) x channels); silence where there is none. Throws as SegmentPackets for a segment whose span
  /// meets the stretch; of others that cannot be read, nothing is heard.
  std::vector<std::int16_t> read(std::int64_t from, std::int64_t to);

 private:
  void read_segment(const IndexedSegment& segment);
  void decode(const AVPacket& packet, std::int64_t place);
  void keep(const AVFrame& sound, std::int64_t place);

  const SegmentOpener& media_;
  const VideoIndex& index_;
  SoundForm form_;
  // Of the call of read() that is under way.
  std::int64_t from_ = 0, to_ = 0;
  std::vector<std::int16_t> samples_;
  media::Codec decoder_;
  std::optional<std::int64_t> expected_;  // where the block after the newest begins
};

}  // namespace kiroku::playback
