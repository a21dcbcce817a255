#include "media/inspector.h"

#include <nlohmann/json.hpp>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include "base/error.h"
#include "media/plaintext_lines.h"
#include "media/sealed_segment.h"
#include "media/segment_input.h"
#include "media/vital_line.h"

namespace kiroku::media {
namespace {

/// More than any camera gives, and less than would exhaust memory.
constexpr std::int64_t kMostPixels = std::int64_t{16'384} * 16'384;

class FrameCounter {
 public:
  FrameCounter(SegmentInput& input, std::string name) : input_(input), name_(std::move(name)) {
    const AVStream& stream = input.video();
    const AVCodec* const decoder = avcodec_find_decoder(stream.codecpar->codec_id);
    if (decoder == nullptr) {
      throw MediaError("the pictures of " + name_ + " are of a kind that this libavcodec cannot decode");
    }
    codec_.reset(avcodec_alloc_context3(decoder));
    if (!codec_) {
      throw std::bad_alloc();
    }
    check(avcodec_parameters_to_context(codec_.get(), stream.codecpar));
    codec_->pkt_timebase = stream.time_base;
    codec_->thread_count = 1;
    codec_->max_pixels = kMostPixels;
    // Damage must be told, not concealed.
    codec_->err_recognition = AV_EF_CRCCHECK | AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_EXPLODE;
    codec_->error_concealment = 0;
    check(avcodec_open2(codec_.get(), decoder, nullptr));
  }

  /// Pictures up to the end; or, if `tolerate_cut`, up to the first that is not whole.
  std::uint64_t count(bool tolerate_cut) {
    const LibavComplaints complaints;
    try {
      const Packet packet = make_packet();
      while (input_.read(*packet)) {
        if (packet->stream_index == input_.video().index) {
          check(avcodec_send_packet(codec_.get(), packet.get()));
          receive();
          require_no_complaint(complaints);
        }
        av_packet_unref(packet.get());
      }
      check(avcodec_send_packet(codec_.get(), nullptr));
      receive();
      require_no_complaint(complaints);
    } catch (const MediaError&) {
      if (!tolerate_cut) {
        throw;
      }
    }
    return frames_;
  }

 private:
  void receive() {
    for (;;) {
      const int result = avcodec_receive_frame(codec_.get(), frame_.get());
      if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) {
        return;
      }
      check(result);
      if (frame_->decode_error_flags != 0 || (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0) {
        check(AVERROR_INVALIDDATA);
      }
      ++frames_;
    }
  }

  void require_no_complaint(const LibavComplaints& complaints) const {
    if (!complaints.first().empty()) {
      throw MediaError("picture " + std::to_string(frames_ == 0 ? 0 : frames_ - 1) + " of " + name_ +
                       " is damaged: " + complaints.first());
    }
  }

  void check(int result) const {
    if (result < 0) {
      throw MediaError("picture " + std::to_string(frames_) + " of " + name_ +
                       " cannot be decoded: " + libav_error_text(result));
    }
  }

  SegmentInput& input_;
  std::string name_;
  Codec codec_;
  Frame frame_ = make_frame();
  std::uint64_t frames_ = 0;
};

std::uint64_t count_frames(const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
                           const SealedSegment& segment) {
  SegmentInput input(segment, stream.media, entry.file.file);
  return FrameCounter(input, entry.file.file).count(!entry.complete);
}

std::uint64_t count_lines(const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
                          const SealedSegment& segment) {
  std::uint64_t lines = 0;
  for_each_line(segment, entry.file.file, kMaximumVitalLineBytes, !entry.complete,
                [&](std::uint64_t number, std::string_view line) {
                  const std::string where = "line " + std::to_string(number) + " of " + entry.file.file;
                  if (stream.kind == "vitals") {
                    const VitalLineParse parse = parse_vital_line_of_any_kind(line);
                    if (!parse.line) {
                      throw MediaError(where + " is no vital sign: " + parse.problem);
                    }
                  } else if (!line.starts_with('{') || !nlohmann::json::accept(line)) {
                    throw MediaError(where + " is no JSON object");
                  }
                  ++lines;
                });
  return lines;
}

std::optional<std::string> inspect(const archive::StreamInfo& stream, const archive::SegmentEntry& entry,
                                   const std::filesystem::path& sealed_file,
                                   const crypto::AgeIdentities& identities) {
  try {
    const SealedSegment segment = SealedSegment::open_unchecked(sealed_file, entry.complete, identities);
    const bool lines = stream.media == "application/jsonl";
    const std::uint64_t counted =
        lines ? count_lines(stream, entry, segment) : count_frames(stream, entry, segment);
    if (entry.complete && entry.counted && counted != entry.frames) {
      const std::string what = stream.kind == "vitals" ? " samples" : lines ? " lines" : " frames";
      return entry.file.file + " holds " + std::to_string(counted) + what + ", the ledger states " +
             std::to_string(entry.frames);
    }
    return std::nullopt;
  } catch (const Error& error) {
    return error.what();
  }
}

}  // namespace

archive::SegmentInspector decoding_inspector() {
  silence_libav();
  return inspect;
}

}  // namespace kiroku::media
