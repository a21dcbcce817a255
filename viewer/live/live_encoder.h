// Pictures into fragments that a browser shows at once: one fragment a picture, nothing held back. An object
// belongs to one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/bytes.h"
#include "recorder/picture_tap.h"
#include "recorder/source/source.h"
#include "viewer/playback/fragment_muxer.h"
#include "viewer/playback/viewing_pictures.h"

namespace kiroku::live {

struct Fragment {
  Bytes bytes;  // `moof` and `mdat` of one picture
  bool is_key = false;
  std::int64_t time_ns = 0;  // of the picture, on the case clock
};

class LiveEncoder {
 public:
  /// For pictures like this one. Throws kiroku::Error for what cannot be shown.
  explicit LiveEncoder(const recorder::PictureTap::Picture& first);

  /// Whether the picture can follow the ones before: of the same size and form, and later.
  [[nodiscard]] bool can_take(const recorder::PictureTap::Picture& picture) const;
  [[nodiscard]] const playback::InitSegment& init() const { return muxer_.init(); }
  /// None while a picture of two fields waits for the next. The first, one a second, and the next one after
  /// `want_key` are key frames.
  std::vector<Fragment> encode(recorder::PictureTap::Picture picture, bool want_key);

 private:
  void encode_one(const playback::ArchivedPicture& picture, std::vector<Fragment>& into);

  recorder::PictureFormat format_;
  playback::ViewingFormat viewing_;
  playback::Ticks interval_;
  playback::ViewingPictures pictures_;
  media::Codec codec_;
  playback::FragmentMuxer muxer_;
  playback::Ticks last_ = -1, last_key_ = -1;
  bool key_wanted_ = true;
};

}  // namespace kiroku::live
