// Copies packets from one container to another, never touching a picture. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <string>

#include "media/output_io.h"
#include "media/segment_input.h"

namespace kiroku::media {

enum class Container { kMatroska, kMp4 };

/// The first time stamp written becomes zero; all others keep their distance to it, gaps included. The same
/// packets give the same bytes: nothing of the day, the machine or chance is written.
class Remuxer {
 public:
  /// `output` must outlive the object; `name` stands in errors.
  Remuxer(OutputFile& output, Container container, std::string name);
  Remuxer(const Remuxer&) = delete;
  Remuxer& operator=(const Remuxer&) = delete;

  /// Copies all packets. The first input decides the streams; later ones must hold the same, with time stamps
  /// that go on. Throws kiroku::Error: a codec that the container cannot hold, a picture of another size or
  /// format than before. `tolerate_cut`: media that ends in mid-packet is copied up to there.
  void copy(SegmentInput& input, bool tolerate_cut = false);
  /// Writes what stands at the end of the container.
  void finish();
  /// Pictures copied.
  [[nodiscard]] std::uint64_t frames() const { return frames_; }

 private:
  void open(SegmentInput& input);
  void require_same_streams(SegmentInput& input) const;
  void check(int result, const std::string& what) const;

  std::string name_;
  Container container_;
  OutputIo io_;
  OutputContext context_;
  std::uint64_t frames_ = 0;
};

}  // namespace kiroku::media
