// Computed pictures as a film: what is simulated, and what is compared. An object belongs to one thread.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "media/png.h"

namespace kiroku::media {

struct FilmFormat {
  int width = 0, height = 0;
  int channels = 3;  // as of PictureView; the same in all pictures
  /// Pictures a second, as a fraction.
  int rate_numerator = 25, rate_denominator = 1;
  /// Of .mp4: a key frame at least every so many pictures, for going back and forth; 0: as the encoder likes.
  int key_interval = 0;
};

/// The ending of the output decides the form:
///   .mp4   H.264 (x264, 4:2:0, BT.709), for any player; sides must be even
///   .mkv   FFV1: decoding gives the pictures back bit for bit (grey as gray, colour as bgr0)
///   none   a folder of 000001.png, 000002.png, …, likewise bit for bit
/// The same pictures give the same bytes with the same libraries, whatever the number of processors; nothing
/// of the day, the machine or chance is written. The film is written beside its name (".part", readable by
/// its owner alone) and gets it in finish(); without that nothing is left behind.
class FilmWriter {
 public:
  /// Throws kiroku::UsageError: another ending, sides that H.264 cannot hold, a rate that is none, an output
  /// that is there and may not be overwritten. A folder is overwritten only where nothing but PNG files is in
  /// it. kiroku::IoError where it cannot be written.
  FilmWriter(const std::filesystem::path& output, const FilmFormat& format, bool overwrite = false);
  ~FilmWriter();
  FilmWriter(const FilmWriter&) = delete;
  FilmWriter& operator=(const FilmWriter&) = delete;

  /// The next picture. Throws kiroku::Error for one of another size; kiroku::IoError (disk full).
  void add(const PictureView& picture);
  /// Throws kiroku::Error for a film without pictures. Nothing may be added after.
  void finish();
  /// Pictures so far.
  [[nodiscard]] std::uint64_t frames() const { return frames_; }

  /// A form of output. Not for callers.
  class Sink;

 private:
  FilmFormat format_;
  std::unique_ptr<Sink> sink_;
  std::uint64_t frames_ = 0;
};

}  // namespace kiroku::media
