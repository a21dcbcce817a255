// Decoded pictures in memory that a decoder in its box (child.h) shares with the program that uses them, so
// that no picture is copied. The first page says which places the user still holds; the rest is cut into
// places as pictures ask for them.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "media/box/child.h"
#include "media/libav_handles.h"

namespace kiroku::media {

/// So much is set aside as addresses; of memory, what pictures fill.
inline constexpr std::size_t kPictureMemoryBytes = std::size_t{1} << 30;
inline constexpr std::size_t kMostPlaces = 512;

/// The first page. Either side may write anything into it at any time.
struct SharedPage {
  /// Counted up by what works in the box, as a sign of life.
  std::atomic<std::uint64_t> pulse;
  /// Pictures in each place that the box handed out and the user has not let go.
  std::array<std::atomic<std::uint16_t>, kMostPlaces> held;
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
inline constexpr std::size_t kSharedPageBytes = 4096;
static_assert(sizeof(SharedPage) <= kSharedPageBytes);

/// What is said of a picture that is handed out: everything that the recorder uses of an AVFrame.
struct PictureNote {
  std::uint32_t place = 0;                   // below kMostPlaces
  std::uint64_t begin = 0, bytes = 0;        // of the place, from the memory's beginning
  std::array<std::uint64_t, 4> planes{};     // from the memory's beginning; 0: none
  std::array<std::int32_t, 4> line_bytes{};  // AVFrame::linesize
  std::int32_t width = 0, height = 0, format = -1;
  std::int32_t aspect_numerator = 0, aspect_denominator = 1;
  std::int32_t range = 0, primaries = 2, transfer = 2, matrix = 2, chroma_location = 0;
  std::uint8_t interlaced = 0, top_field_first = 0, key = 0, reserved = 0;
};

/// In the box: places for pictures. Thread-safe, as decoders have threads.
class PictureLender {
 public:
  explicit PictureLender(int descriptor);

  /// For AVCodecContext::get_buffer2: what `codec` decodes lies in the shared memory, where there is room.
  /// The object must outlive the codec and its pictures.
  void lend_to(AVCodecContext& codec);
  /// `bytes` of the shared memory, null where there is no room.
  BufferReference take(std::size_t bytes);
  /// Hands `picture` out, copying it where it does not lie in one place of the memory. False where there is
  /// no room for it: then it is lost.
  bool hand_out(const AVFrame& picture, PictureNote& note);
  [[nodiscard]] SharedPage& page() const;

 private:
  struct Place {
    std::size_t begin = 0, bytes = 0;
    bool lent = false;  // to something in the box
  };
  struct Lent {
    PictureLender* lender;
    std::size_t place;
  };
  static int get_buffer(AVCodecContext* codec, AVFrame* frame, int flags);
  static void give_back(void* lent, std::uint8_t* data);
  bool fill(AVCodecContext& codec, AVFrame& frame);
  [[nodiscard]] bool is_free(std::size_t place) const;
  /// kMostPlaces where there is no room.
  std::size_t find_place(std::size_t bytes);
  [[nodiscard]] std::size_t place_of(const AVFrame& picture) const;
  bool describe(const AVFrame& picture, std::size_t place, PictureNote& note) const;

  Mapping memory_;
  std::mutex mutex_;  // guards what follows
  std::vector<Place> places_;
  std::size_t end_ = kSharedPageBytes;  // of the last place
};

/// With the user: the same memory, pictures to be read only.
class PictureBorrower : public std::enable_shared_from_this<PictureBorrower> {
 public:
  explicit PictureBorrower(int descriptor);

  /// The picture, which lies where the box wrote it until the frame and all references to it are gone: the
  /// object lives as long. Throws kiroku::Error where the note does not fit the memory, or names what no
  /// picture is like.
  Frame borrow(const PictureNote& note);
  [[nodiscard]] std::uint64_t pulse() const { return page().pulse.load(std::memory_order_relaxed); }

 private:
  [[nodiscard]] SharedPage& page() const;
  static void give_back(void* held, std::uint8_t* data);

  Mapping page_, pictures_;
};

}  // namespace kiroku::media
