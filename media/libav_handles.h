// libav (FFmpeg) objects as unique_ptr, its errors as kiroku::Error, its chatter kept off the terminal. Every
// libav handle of the project is one of these. The libav headers themselves stay in .cpp files: this header
// only names their types.
//
// Deleters are stateless and accept only what libav's own free function accepts; each frees the object and
// everything it owns. Free functions are thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "base/error.h"

struct AVBSFContext;
struct AVBufferRef;
struct AVCodecContext;
struct AVCodecParameters;
struct AVCodecParserContext;
struct AVDictionary;
struct AVFilterGraph;
struct AVFilterInOut;
struct AVFormatContext;
struct AVFrame;
struct AVIOContext;
struct AVPacket;
struct SwsContext;

namespace kiroku::media {

struct LibavDeleter {
  void operator()(AVBSFContext* object) const noexcept;
  void operator()(AVBufferRef* object) const noexcept;
  void operator()(AVCodecContext* object) const noexcept;
  void operator()(AVCodecParameters* object) const noexcept;
  void operator()(AVCodecParserContext* object) const noexcept;
  void operator()(AVDictionary* object) const noexcept;
  void operator()(AVFilterGraph* object) const noexcept;
  void operator()(AVFilterInOut* object) const noexcept;
  void operator()(AVFrame* object) const noexcept;
  void operator()(AVPacket* object) const noexcept;
  void operator()(SwsContext* object) const noexcept;
};
/// avformat_close_input: also closes an AVIOContext that libav itself opened, not one given to it.
struct InputDeleter {
  void operator()(AVFormatContext* object) const noexcept;
};
/// avformat_free_context: the AVIOContext is the caller's and must outlive the context.
struct OutputDeleter {
  void operator()(AVFormatContext* object) const noexcept;
};
/// For avio_alloc_context over callbacks: frees the context and its buffer. Never for avio_open.
struct CustomIoDeleter {
  void operator()(AVIOContext* object) const noexcept;
};

using BitstreamFilter = std::unique_ptr<AVBSFContext, LibavDeleter>;
using BufferReference = std::unique_ptr<AVBufferRef, LibavDeleter>;
using Codec = std::unique_ptr<AVCodecContext, LibavDeleter>;
using CodecParameters = std::unique_ptr<AVCodecParameters, LibavDeleter>;
using CodecParser = std::unique_ptr<AVCodecParserContext, LibavDeleter>;
using FilterGraph = std::unique_ptr<AVFilterGraph, LibavDeleter>;
using FilterInOut = std::unique_ptr<AVFilterInOut, LibavDeleter>;
using Frame = std::unique_ptr<AVFrame, LibavDeleter>;
using Packet = std::unique_ptr<AVPacket, LibavDeleter>;
using Scaler = std::unique_ptr<SwsContext, LibavDeleter>;
using InputContext = std::unique_ptr<AVFormatContext, InputDeleter>;
using OutputContext = std::unique_ptr<AVFormatContext, OutputDeleter>;
using CustomIo = std::unique_ptr<AVIOContext, CustomIoDeleter>;

Frame make_frame();    // empty; throws std::bad_alloc
Packet make_packet();  // likewise
/// Another reference to the same picture; throws std::bad_alloc.
Frame reference(const AVFrame& frame);

/// Options for a libav call that takes AVDictionary**. Owns the dictionary; not thread-safe.
class Options {
 public:
  Options() = default;
  Options(Options&& other) noexcept;
  Options& operator=(Options&& other) noexcept;
  Options(const Options&) = delete;
  Options& operator=(const Options&) = delete;
  ~Options();
  void set(const std::string& key, const std::string& value);
  /// For the call; libav replaces the dictionary by what it did not understand.
  [[nodiscard]] AVDictionary** address() { return &dictionary_; }
  /// First option that nobody took, "" if all were.
  [[nodiscard]] std::string unused() const;

 private:
  AVDictionary* dictionary_ = nullptr;
};

/// Text of a libav error code, e.g. "Invalid data found when processing input".
std::string libav_error_text(int code);

/// A call of libav failed.
class LibavError : public Error {
 public:
  using Error::Error;
};

/// Throws LibavError "<what>: <text of code>"; `what` says what failed and where, e.g. "cannot open the
/// camera /dev/video0".
[[noreturn]] void throw_libav(const std::string& what, int code);
/// `code` itself if it is no error, else throw_libav.
int require(int code, const std::string& what);

/// Receives one finished line of libav's log without its line end; `level` is AV_LOG_ERROR, AV_LOG_WARNING, …
/// (smaller is worse). Called from any thread, one call at a time; it must not call libav.
/// What libav's own level (by default AV_LOG_INFO) leaves out does not come here either.
using LibavLogSink = std::function<void(int level, std::string_view line)>;
/// From now on libav's log goes to `sink`, and nowhere if that is empty. Until the first call libav prints on
/// standard error.
void route_libav_log(LibavLogSink sink);
/// As route_libav_log({}), unless a sink is already set. Everything in this project that opens libav calls
/// it, so that no program can forget; calling it again does nothing.
void silence_libav();

/// What libav logs as an error in this thread while the object lives: some decoders conceal damage and tell
/// of it nowhere else (FFV1 a wrong checksum). Calls silence_libav. Lives and dies in one thread, the newest
/// first.
class LibavComplaints {
 public:
  LibavComplaints();
  ~LibavComplaints();
  LibavComplaints(const LibavComplaints&) = delete;
  LibavComplaints& operator=(const LibavComplaints&) = delete;
  /// The first line, "" if there was none.
  [[nodiscard]] const std::string& first() const { return first_; }
  void clear() { first_.clear(); }

  /// For the log's receiver.
  void take(std::string_view line);

 private:
  std::string first_;
  LibavComplaints* outer_;
};

}  // namespace kiroku::media
