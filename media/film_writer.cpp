#include "media/film_writer.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <thread>
#include <utility>

extern "C" {
#include <libswscale/swscale.h>

#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/cpu.h>
}

#include "base/error.h"
#include "media/ffv1_slices.h"
#include "media/output_io.h"

namespace kiroku::media {
namespace {

namespace fs = std::filesystem;

enum class Form : std::uint8_t { kH264, kFfv1, kPictures };

Form form_of(const fs::path& output) {
  const fs::path ending = output.extension();
  if (ending == ".mp4") return Form::kH264;
  if (ending == ".mkv") return Form::kFfv1;
  if (ending.empty()) return Form::kPictures;
  throw UsageError("the film " + output.string() +
                   " must end in .mp4 (H.264) or .mkv (FFV1, lossless), or be a folder's name for PNG files");
}

void require_valid(const FilmFormat& format, Form form) {
  const std::string size = std::to_string(format.width) + "x" + std::to_string(format.height);
  constexpr int kLargestSide = 16384;
  if (format.width < 1 || format.height < 1 || format.width > kLargestSide || format.height > kLargestSide) {
    throw UsageError("a film of " + size + " pixels cannot be written: sides must be from 1 to 16384");
  }
  if (format.rate_numerator < 1 || format.rate_denominator < 1) {
    throw UsageError("a film of " + std::to_string(format.rate_numerator) + "/" +
                     std::to_string(format.rate_denominator) +
                     " pictures a second cannot be written: there must be some");
  }
  if (form == Form::kH264 && (format.width % 2 != 0 || format.height % 2 != 0)) {
    throw UsageError(
        "a film of " + size +
        " pixels cannot be .mp4: H.264 halves the colours, so sides must be even; choose others, "
        "or .mkv");
  }
}

std::string picture_name(std::uint64_t number) {
  std::array<char, 32> name{};
  std::snprintf(name.data(), name.size(), "%06llu.png", static_cast<unsigned long long>(number));
  return name.data();
}

}  // namespace

class FilmWriter::Sink {
 public:
  Sink() = default;
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  virtual ~Sink() = default;
  virtual void add(const PictureView& picture) = 0;
  virtual void finish() = 0;
};

namespace {

/// Pictures encoded into one file.
class FilmFile : public FilmWriter::Sink {
 public:
  FilmFile(const fs::path& output, const FilmFormat& format, Form form, bool overwrite)
      : name_(output.string()), file_(output, overwrite), io_(file_) {
    silence_libav();
    open_encoder(format, form);
    open_container(form);
    const AVPixelFormat given = format.channels == 1 ? AV_PIX_FMT_GRAY8 : AV_PIX_FMT_RGB24;
    if (given != encoder_->pix_fmt) open_scaler(given);
  }

  void add(const PictureView& picture) override {
    const std::array<const std::uint8_t*, 4> data{picture.samples.data()};
    const std::array<int, 4> lines{picture.width * picture.channels};
    const Frame frame = make_frame();
    frame->width = picture.width;
    frame->height = picture.height;
    frame->format = encoder_->pix_fmt;
    frame->color_range = encoder_->color_range;
    frame->pts = next_++;
    require(av_frame_get_buffer(frame.get(), 0), "cannot write " + name_);
    if (scaler_) {
      require(sws_scale(scaler_.get(), data.data(), lines.data(), 0, picture.height, frame->data,
                        frame->linesize),
              "cannot convert a picture of " + name_);
    } else {
      copy_rows(*frame, picture);
    }
    encode(frame.get());
  }

  void finish() override {
    encode(nullptr);
    io_.check(av_write_trailer(container_.get()), "cannot finish " + name_);
    io_.flush("cannot finish " + name_);
    file_.commit();
  }

 private:
  static void copy_rows(AVFrame& frame, const PictureView& picture) {
    for (int y = 0; y < picture.height; ++y) {
      std::copy_n(picture.samples.data() + std::ptrdiff_t{y} * picture.width, picture.width,
                  frame.data[0] + std::ptrdiff_t{y} * frame.linesize[0]);
    }
  }

  void open_encoder(const FilmFormat& format, Form form) {
    const AVCodec* const codec = form == Form::kH264 ? avcodec_find_encoder_by_name("libx264")
                                                     : avcodec_find_encoder(AV_CODEC_ID_FFV1);
    if (codec == nullptr) {
      throw Error(form == Form::kH264
                      ? "this libavcodec has no x264 for .mp4; write the film as .mkv"
                      : "this libavcodec cannot encode FFV1; install Debian's FFmpeg libraries");
    }
    encoder_.reset(avcodec_alloc_context3(codec));
    if (!encoder_) throw std::bad_alloc();
    encoder_->width = format.width;
    encoder_->height = format.height;
    encoder_->framerate = {format.rate_numerator, format.rate_denominator};
    encoder_->time_base = av_inv_q(encoder_->framerate);
    encoder_->sample_aspect_ratio = {1, 1};
    encoder_->flags |= static_cast<int>(AV_CODEC_FLAG_BITEXACT | AV_CODEC_FLAG_GLOBAL_HEADER);
    Options options;
    if (form == Form::kH264) {
      encoder_->pix_fmt = AV_PIX_FMT_YUV420P;
      encoder_->color_range = AVCOL_RANGE_MPEG;
      encoder_->colorspace = AVCOL_SPC_BT709;
      encoder_->color_primaries = AVCOL_PRI_BT709;
      encoder_->color_trc = AVCOL_TRC_BT709;
      // x264's bytes depend on how many threads it has, so it always has as many.
      constexpr int kThreads = 4;
      encoder_->thread_count = kThreads;
      options.set("preset", "medium");
      options.set("crf", "18");
      // With AVX-512 the bytes of x264 0.164 depend on memory it never wrote (seen up to 320x240); with AVX2
      // they do not, and are made as fast.
      if ((av_get_cpu_flags() & AV_CPU_FLAG_AVX512) != 0) options.set("x264-params", "asm=AVX2");
      if (format.key_interval > 0) encoder_->gop_size = format.key_interval;
    } else {
      encoder_->pix_fmt = format.channels == 1 ? AV_PIX_FMT_GRAY8 : AV_PIX_FMT_BGR0;
      encoder_->color_range = format.channels == 1 ? AVCOL_RANGE_JPEG : AVCOL_RANGE_UNSPECIFIED;
      encoder_->gop_size = 1;
      encoder_->level = 3;
      // FFV1's bytes depend on the number of slices alone.
      encoder_->thread_count = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 4);
      options.set("slicecrc", "1");
      options.set("slices", ffv1_slices(format.width, format.height));
    }
    require(avcodec_open2(encoder_.get(), codec, options.address()), "cannot encode " + name_);
  }

  void open_container(Form form) {
    AVFormatContext* raw = nullptr;
    require(avformat_alloc_output_context2(&raw, nullptr, form == Form::kH264 ? "mp4" : "matroska", nullptr),
            "cannot begin " + name_);
    container_.reset(raw);
    container_->pb = io_.context();
    container_->flags |= AVFMT_FLAG_CUSTOM_IO | AVFMT_FLAG_BITEXACT;
    AVStream* const stream = avformat_new_stream(container_.get(), nullptr);
    if (stream == nullptr) throw std::bad_alloc();
    require(avcodec_parameters_from_context(stream->codecpar, encoder_.get()), "cannot begin " + name_);
    stream->time_base = encoder_->time_base;
    stream->avg_frame_rate = encoder_->framerate;
    io_.check(avformat_write_header(container_.get(), nullptr), "cannot begin " + name_);
  }

  void open_scaler(AVPixelFormat given) {
    // Without the exact flags swscale's results depend on the processor.
    constexpr int kFlags = SWS_BICUBIC | SWS_ACCURATE_RND | SWS_BITEXACT | SWS_FULL_CHR_H_INP;
    scaler_.reset(sws_getContext(encoder_->width, encoder_->height, given, encoder_->width, encoder_->height,
                                 encoder_->pix_fmt, kFlags, nullptr, nullptr, nullptr));
    if (!scaler_) throw Error("cannot convert the pictures of " + name_ + ": swscale refuses their format");
    constexpr int kUnchanged = 1 << 16;
    const int* const bt709 = sws_getCoefficients(SWS_CS_ITU709);
    sws_setColorspaceDetails(scaler_.get(), bt709, 1, bt709, 0, 0, kUnchanged, kUnchanged);
  }

  void encode(const AVFrame* frame) {
    require(avcodec_send_frame(encoder_.get(), frame), "cannot encode a picture of " + name_);
    const Packet packet = make_packet();
    for (;;) {
      const int result = avcodec_receive_packet(encoder_.get(), packet.get());
      if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
      require(result, "cannot encode a picture of " + name_);
      AVStream& stream = *container_->streams[0];
      packet->stream_index = 0;
      packet->duration = 1;
      av_packet_rescale_ts(packet.get(), encoder_->time_base, stream.time_base);
      io_.check(av_interleaved_write_frame(container_.get(), packet.get()), "cannot write " + name_);
    }
  }

  std::string name_;
  OutputFile file_;
  OutputIo io_;
  Codec encoder_;
  OutputContext container_;
  Scaler scaler_;
  std::int64_t next_ = 0;
};

/// Pictures as files of a folder.
class FilmFolder : public FilmWriter::Sink {
 public:
  FilmFolder(const fs::path& output, bool overwrite)
      : folder_(output.has_filename() ? output : output.parent_path()),
        part_(folder_),
        overwrite_(overwrite) {
    part_ += ".part";
    require_replaceable(folder_, overwrite_);
    // What an earlier run that was killed left behind.
    require_replaceable(part_, true);
    std::error_code failed;
    fs::remove_all(part_, failed);
    if (!failed) fs::create_directories(part_, failed);
    if (!failed) fs::permissions(part_, fs::perms::owner_all, failed);
    if (failed) throw IoError("create", part_, failed.value());
  }
  ~FilmFolder() override {
    std::error_code ignored;
    if (!finished_) fs::remove_all(part_, ignored);
  }
  FilmFolder(const FilmFolder&) = delete;
  FilmFolder& operator=(const FilmFolder&) = delete;

  void add(const PictureView& picture) override {
    OutputFile file(part_ / picture_name(++count_), true);
    file.write(png_of(picture));
    file.commit();
  }

  void finish() override {
    require_replaceable(folder_, overwrite_);
    std::error_code failed;
    fs::remove_all(folder_, failed);
    if (!failed) fs::rename(part_, folder_, failed);
    if (failed) throw IoError("rename to its final name", part_, failed.value());
    finished_ = true;
  }

 private:
  static void require_replaceable(const fs::path& folder, bool overwrite) {
    if (!fs::exists(fs::symlink_status(folder))) return;
    if (!fs::is_directory(fs::symlink_status(folder))) {
      throw UsageError("the output " + folder.string() + " is there and no folder; choose another name");
    }
    const auto is_picture = [](const fs::directory_entry& entry) {
      const fs::path ending = entry.path().extension();
      return entry.is_regular_file() && (ending == ".png" || ending == ".part");
    };
    if (!std::all_of(fs::directory_iterator(folder), fs::directory_iterator(), is_picture)) {
      throw UsageError("the folder " + folder.string() +
                       " holds other things than pictures, which would be lost; choose another name");
    }
    if (!overwrite && !fs::is_empty(folder)) {
      throw UsageError("the folder " + folder.string() +
                       " is already there; choose another name, or overwrite its pictures with --force");
    }
  }

  fs::path folder_, part_;
  bool overwrite_, finished_ = false;
  std::uint64_t count_ = 0;
};

}  // namespace

FilmWriter::FilmWriter(const fs::path& output, const FilmFormat& format, bool overwrite) : format_(format) {
  const Form form = form_of(output);
  require_valid(format, form);
  if (form == Form::kPictures) {
    sink_ = std::make_unique<FilmFolder>(output, overwrite);
  } else {
    sink_ = std::make_unique<FilmFile>(output, format, form, overwrite);
  }
}

FilmWriter::~FilmWriter() = default;

void FilmWriter::add(const PictureView& picture) {
  media::require_valid(picture);
  if (picture.width != format_.width || picture.height != format_.height ||
      picture.channels != format_.channels) {
    throw Error("a film's pictures must all be alike: picture " + std::to_string(frames_ + 1) + " is " +
                std::to_string(picture.width) + "x" + std::to_string(picture.height) + " in " +
                std::to_string(picture.channels) + " channels, the film " + std::to_string(format_.width) +
                "x" + std::to_string(format_.height) + " in " + std::to_string(format_.channels));
  }
  sink_->add(picture);
  ++frames_;
}

void FilmWriter::finish() {
  if (frames_ == 0) throw Error("a film without pictures cannot be written");
  sink_->finish();
}

}  // namespace kiroku::media
