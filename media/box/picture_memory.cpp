#include "media/box/picture_memory.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <sys/mman.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/frame.h>
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
}

#include "base/error.h"

namespace kiroku::media {
namespace {

/// Of places and planes: as wide as any vector instruction reads.
constexpr std::size_t kAlignment = 64;
/// What decoders and converters may read or write behind a plane.
constexpr std::size_t kBehindPlane = 64;
/// As media::PictureDecoder: more than any camera gives.
constexpr int kLargestSide = 16'384;

std::size_t aligned(std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

std::array<std::size_t, 4> plane_bytes(int format, int height, const int* line_bytes) {
  std::array<std::ptrdiff_t, 4> lines{};
  std::copy_n(line_bytes, 4, lines.begin());
  std::array<std::size_t, 4> bytes{};
  if (av_image_fill_plane_sizes(bytes.data(), static_cast<AVPixelFormat>(format), height, lines.data()) < 0)
    return {};
  return bytes;
}

/// Planes one behind the other in one buffer; false where the format has none.
bool lay_out(AVFrame& frame, int format, int width, int height, const int* line_alignment) {
  const auto pixels = static_cast<AVPixelFormat>(format);
  int most = 1;
  for (int i = 0; i < 4; ++i) most = std::max(most, line_alignment[i]);
  int tried = width;
  bool fits = false;
  while (!fits) {
    if (av_image_fill_linesizes(frame.linesize, pixels, tried) < 0) return false;
    fits = true;
    for (int i = 0; i < 4; ++i) fits = fits && frame.linesize[i] % most == 0;
    // As libavcodec does: the lowest bit more, until every plane's lines are aligned.
    tried += tried & ~(tried - 1);
  }
  return plane_bytes(format, height, frame.linesize)[0] > 0;
}

void point_into(AVFrame& frame, int format, int height, std::uint8_t* at) {
  const std::array<std::size_t, 4> bytes = plane_bytes(format, height, frame.linesize);
  for (std::size_t i = 0; i < 4; ++i) {
    frame.data[i] = bytes[i] > 0 ? at : nullptr;
    at += bytes[i] > 0 ? aligned(bytes[i] + kBehindPlane) : 0;
  }
  frame.extended_data = frame.data;
}

std::size_t bytes_to_hold(int format, int height, const int* line_bytes) {
  std::size_t all = 0;
  for (const std::size_t bytes : plane_bytes(format, height, line_bytes)) {
    if (bytes > 0) all += aligned(bytes + kBehindPlane);
  }
  return all;
}

}  // namespace

// --- in the box --------------------------------------------------------------------------------------------

PictureLender::PictureLender(int descriptor)
    : memory_(descriptor, kPictureMemoryBytes, PROT_READ | PROT_WRITE) {}

SharedPage& PictureLender::page() const { return *reinterpret_cast<SharedPage*>(memory_.data()); }

void PictureLender::lend_to(AVCodecContext& codec) {
  codec.opaque = this;
  codec.get_buffer2 = get_buffer;
}

int PictureLender::get_buffer(AVCodecContext* codec, AVFrame* frame, int flags) {
  if (codec->codec_type == AVMEDIA_TYPE_VIDEO && (codec->codec->capabilities & AV_CODEC_CAP_DR1) != 0 &&
      static_cast<PictureLender*>(codec->opaque)->fill(*codec, *frame)) {
    return 0;
  }
  return avcodec_default_get_buffer2(codec, frame, flags);
}

bool PictureLender::fill(AVCodecContext& codec, AVFrame& frame) {
  int width = frame.width;
  int height = frame.height;
  int line_alignment[AV_NUM_DATA_POINTERS] = {};
  avcodec_align_dimensions2(&codec, &width, &height, line_alignment);
  if (!lay_out(frame, frame.format, width, height, line_alignment)) return false;
  BufferReference buffer = take(bytes_to_hold(frame.format, height, frame.linesize));
  if (!buffer) return false;
  point_into(frame, frame.format, height, buffer->data);
  const AVPixFmtDescriptor* const described = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  if (described != nullptr && (described->flags & AV_PIX_FMT_FLAG_PAL) != 0)
    std::memset(frame.data[1], 0, 1024);
  frame.buf[0] = buffer.release();
  return true;
}

bool PictureLender::is_free(std::size_t place) const {
  return !places_[place].lent && page().held[place].load(std::memory_order_acquire) == 0;
}

std::size_t PictureLender::find_place(std::size_t bytes) {
  std::size_t found = kMostPlaces;
  bool all_free = true;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (!is_free(i)) {
      all_free = false;
    } else if (places_[i].bytes >= bytes &&
               (found == kMostPlaces || places_[i].bytes < places_[found].bytes)) {
      found = i;
    }
  }
  // A sound's place is not for a picture that would fill a thousandth of it.
  if (found != kMostPlaces && places_[found].bytes <= 2 * bytes) return found;
  if (places_.size() < kMostPlaces && bytes <= kPictureMemoryBytes - kSharedPageBytes - end_) {
    places_.push_back({end_, bytes, false});
    end_ += bytes;
    return places_.size() - 1;
  }
  if (found != kMostPlaces || !all_free || bytes > kPictureMemoryBytes - 2 * kSharedPageBytes) return found;
  // Pictures of other sizes came before: they are all gone, and so are their places.
  places_.assign(1, {kSharedPageBytes, bytes, false});
  end_ = kSharedPageBytes + bytes;
  return 0;
}

BufferReference PictureLender::take(std::size_t bytes) {
  bytes = aligned(std::max<std::size_t>(bytes, 1));
  auto lent = std::make_unique<Lent>();
  std::uint8_t* at = nullptr;
  {
    const std::lock_guard guard(mutex_);
    const std::size_t place = find_place(bytes);
    if (place == kMostPlaces) return {};
    places_[place].lent = true;
    *lent = {this, place};
    at = reinterpret_cast<std::uint8_t*>(memory_.data() + places_[place].begin);
  }
  BufferReference buffer(av_buffer_create(at, bytes, give_back, lent.get(), 0));
  if (!buffer) {
    give_back(lent.release(), at);
    throw std::bad_alloc();
  }
  (void)lent.release();
  return buffer;
}

void PictureLender::give_back(void* lent, std::uint8_t* /*data*/) {
  const std::unique_ptr<Lent> owned(static_cast<Lent*>(lent));
  const std::lock_guard guard(owned->lender->mutex_);
  owned->lender->places_[owned->place].lent = false;
}

std::size_t PictureLender::place_of(const AVFrame& picture) const {
  if (picture.buf[0] == nullptr || picture.buf[1] != nullptr) return kMostPlaces;
  const auto* const at = reinterpret_cast<const std::byte*>(picture.data[0]);
  if (at < memory_.data() || at >= memory_.data() + memory_.size()) return kMostPlaces;
  const auto offset = static_cast<std::size_t>(at - memory_.data());
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (offset >= places_[i].begin && offset < places_[i].begin + places_[i].bytes) return i;
  }
  return kMostPlaces;
}

bool PictureLender::describe(const AVFrame& picture, std::size_t place, PictureNote& note) const {
  const Place& in = places_[place];
  const std::array<std::size_t, 4> bytes = plane_bytes(picture.format, picture.height, picture.linesize);
  note = {};
  if (bytes[0] == 0) return false;
  for (std::size_t i = 0; i < 4; ++i) {
    note.line_bytes[i] = picture.linesize[i];
    if (picture.linesize[i] < 0) return false;
    if (bytes[i] == 0) continue;
    const auto offset =
        static_cast<std::size_t>(reinterpret_cast<const std::byte*>(picture.data[i]) - memory_.data());
    if (offset < in.begin || offset + bytes[i] > in.begin + in.bytes) return false;
    note.planes[i] = offset;
  }
  note.place = static_cast<std::uint32_t>(place);
  note.begin = in.begin;
  note.bytes = in.bytes;
  note.width = picture.width;
  note.height = picture.height;
  note.format = picture.format;
  note.aspect_numerator = picture.sample_aspect_ratio.num;
  note.aspect_denominator = picture.sample_aspect_ratio.den;
  note.range = picture.color_range;
  note.primaries = picture.color_primaries;
  note.transfer = picture.color_trc;
  note.matrix = picture.colorspace;
  note.chroma_location = picture.chroma_location;
#if LIBAVUTIL_VERSION_MAJOR >= 58
  note.interlaced = (picture.flags & AV_FRAME_FLAG_INTERLACED) != 0;
  note.top_field_first = (picture.flags & AV_FRAME_FLAG_TOP_FIELD_FIRST) != 0;
  note.key = (picture.flags & AV_FRAME_FLAG_KEY) != 0;
#else
  note.interlaced = picture.interlaced_frame != 0;
  note.top_field_first = picture.top_field_first != 0;
  note.key = picture.key_frame != 0;
#endif
  return true;
}

bool PictureLender::hand_out(const AVFrame& picture, PictureNote& note) {
  {
    const std::lock_guard guard(mutex_);
    const std::size_t place = place_of(picture);
    if (place != kMostPlaces && describe(picture, place, note)) {
      page().held[place].fetch_add(1, std::memory_order_acq_rel);
      return true;
    }
  }
  const Frame copy = make_frame();
  constexpr std::array<int, 4> kAligned{kAlignment, kAlignment, kAlignment, kAlignment};
  if (!lay_out(*copy, picture.format, picture.width, picture.height, kAligned.data())) return false;
  BufferReference buffer = take(bytes_to_hold(picture.format, picture.height, copy->linesize));
  if (!buffer) return false;
  point_into(*copy, picture.format, picture.height, buffer->data);
  copy->buf[0] = buffer.release();
  copy->format = picture.format;
  copy->width = picture.width;
  copy->height = picture.height;
  if (av_frame_copy(copy.get(), &picture) < 0 || av_frame_copy_props(copy.get(), &picture) < 0) return false;
  const std::lock_guard guard(mutex_);
  const std::size_t place = place_of(*copy);
  if (place == kMostPlaces || !describe(*copy, place, note)) return false;
  page().held[place].fetch_add(1, std::memory_order_acq_rel);
  return true;
}

// --- with the user -----------------------------------------------------------------------------------------

namespace {

struct Held {
  std::shared_ptr<PictureBorrower> borrower;
  std::size_t place;
};

template <typename Enum>
Enum known(std::int32_t value, int count, Enum otherwise) {
  return value >= 0 && value < count ? static_cast<Enum>(value) : otherwise;
}

void require_fit(bool fits) {
  if (!fits) throw Error("the decoder gave a picture that cannot be; it is not believed");
}

}  // namespace

PictureBorrower::PictureBorrower(int descriptor)
    : page_(descriptor, kSharedPageBytes, PROT_READ | PROT_WRITE),
      pictures_(descriptor, kPictureMemoryBytes, PROT_READ) {}

SharedPage& PictureBorrower::page() const { return *reinterpret_cast<SharedPage*>(page_.data()); }

Frame PictureBorrower::borrow(const PictureNote& note) {
  const AVPixFmtDescriptor* const described = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(note.format));
  require_fit(described != nullptr && (described->flags & AV_PIX_FMT_FLAG_HWACCEL) == 0);
  require_fit(note.place < kMostPlaces && note.width > 0 && note.height > 0 && note.width <= kLargestSide &&
              note.height <= kLargestSide);
  // The last page is never a picture's, so that reading a little behind one meets memory.
  constexpr std::uint64_t kEnd = kPictureMemoryBytes - kSharedPageBytes;
  require_fit(note.begin >= kSharedPageBytes && note.bytes <= kEnd && note.begin <= kEnd - note.bytes);
  std::array<int, 4> least{};
  require_fit(av_image_fill_linesizes(least.data(), static_cast<AVPixelFormat>(note.format), note.width) >=
              0);
  for (std::size_t i = 0; i < 4; ++i) {
    require_fit(note.line_bytes[i] >= least[i] && note.line_bytes[i] <= (kLargestSide + 1024) * 16);
  }
  const std::array<std::size_t, 4> bytes = plane_bytes(note.format, note.height, note.line_bytes.data());
  require_fit(bytes[0] > 0);
  Frame frame = make_frame();
  for (std::size_t i = 0; i < 4; ++i) {
    frame->linesize[i] = note.line_bytes[i];
    if (bytes[i] == 0) continue;
    require_fit(note.planes[i] >= note.begin && bytes[i] <= note.bytes &&
                note.planes[i] - note.begin <= note.bytes - bytes[i]);
    // Nobody writes to it here: the mapping would not let them, and the buffer says so.
    frame->data[i] =
        const_cast<std::uint8_t*>(reinterpret_cast<const std::uint8_t*>(pictures_.data() + note.planes[i]));
  }
  frame->extended_data = frame->data;
  frame->width = note.width;
  frame->height = note.height;
  frame->format = note.format;
  if (note.aspect_numerator > 0 && note.aspect_denominator > 0)
    frame->sample_aspect_ratio = {note.aspect_numerator, note.aspect_denominator};
  frame->color_range = known(note.range, AVCOL_RANGE_NB, AVCOL_RANGE_UNSPECIFIED);
  frame->color_primaries = known(note.primaries, AVCOL_PRI_NB, AVCOL_PRI_UNSPECIFIED);
  frame->color_trc = known(note.transfer, AVCOL_TRC_NB, AVCOL_TRC_UNSPECIFIED);
  frame->colorspace = known(note.matrix, AVCOL_SPC_NB, AVCOL_SPC_UNSPECIFIED);
  frame->chroma_location = known(note.chroma_location, AVCHROMA_LOC_NB, AVCHROMA_LOC_UNSPECIFIED);
#if LIBAVUTIL_VERSION_MAJOR >= 58
  if (note.interlaced != 0) frame->flags |= AV_FRAME_FLAG_INTERLACED;
  if (note.top_field_first != 0) frame->flags |= AV_FRAME_FLAG_TOP_FIELD_FIRST;
  if (note.key != 0) frame->flags |= AV_FRAME_FLAG_KEY;
#else
  frame->interlaced_frame = note.interlaced != 0 ? 1 : 0;
  frame->top_field_first = note.top_field_first != 0 ? 1 : 0;
  frame->key_frame = note.key != 0 ? 1 : 0;
#endif
  auto held = std::make_unique<Held>(Held{shared_from_this(), note.place});
  auto* const at =
      const_cast<std::uint8_t*>(reinterpret_cast<const std::uint8_t*>(pictures_.data() + note.begin));
  frame->buf[0] = av_buffer_create(at, note.bytes, give_back, held.get(), AV_BUFFER_FLAG_READONLY);
  if (frame->buf[0] == nullptr) throw std::bad_alloc();
  (void)held.release();
  return frame;
}

void PictureBorrower::give_back(void* held, std::uint8_t* /*data*/) {
  const std::unique_ptr<Held> owned(static_cast<Held*>(held));
  owned->borrower->page().held[owned->place].fetch_sub(1, std::memory_order_acq_rel);
}

}  // namespace kiroku::media
