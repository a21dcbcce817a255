#include "viewer/compare/recorded_pictures.h"

namespace kiroku::compare {

RecordedPictures::RecordedPictures(const archive::CaseReader& recording,
                                   const crypto::AgeIdentities& identities, const std::string& stream,
                                   std::int64_t from_ns, std::int64_t to_ns, int width, int height)
    : reader_(recording, identities, stream, from_ns, to_ns),
      pending_(reader_.next()),
      picture_(width, height) {}

const sim::Picture& RecordedPictures::at(std::int64_t case_ns) {
  bool newer = false;
  while (pending_ && reader_.time_ns() <= case_ns) {
    newer = true;
    taken_ns_ = reader_.time_ns();
    pending_ = reader_.next();
  }
  // The reader is one picture ahead.
  if (newer) picture_.rgb = reader_.rgb_of_one_before(picture_.width, picture_.height);
  return picture_;
}

}  // namespace kiroku::compare
