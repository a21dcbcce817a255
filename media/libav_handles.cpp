#include "media/libav_handles.h"

#include <array>
#include <cstdarg>
#include <mutex>
#include <new>
#include <utility>

extern "C" {
#include <libswscale/swscale.h>

#include <libavcodec/avcodec.h>
#include <libavcodec/bsf.h>
#include <libavformat/avformat.h>
#include <libavutil/dict.h>
#include <libavutil/log.h>
}

#include "base/error.h"

namespace kiroku::media {

void LibavDeleter::operator()(AVBSFContext* object) const noexcept { av_bsf_free(&object); }
void LibavDeleter::operator()(AVBufferRef* object) const noexcept { av_buffer_unref(&object); }
void LibavDeleter::operator()(AVCodecContext* object) const noexcept { avcodec_free_context(&object); }
void LibavDeleter::operator()(AVCodecParameters* object) const noexcept { avcodec_parameters_free(&object); }
void LibavDeleter::operator()(AVCodecParserContext* object) const noexcept { av_parser_close(object); }
void LibavDeleter::operator()(AVDictionary* object) const noexcept { av_dict_free(&object); }
void LibavDeleter::operator()(AVFrame* object) const noexcept { av_frame_free(&object); }
void LibavDeleter::operator()(AVPacket* object) const noexcept { av_packet_free(&object); }
void LibavDeleter::operator()(SwsContext* object) const noexcept { sws_freeContext(object); }
void InputDeleter::operator()(AVFormatContext* object) const noexcept { avformat_close_input(&object); }
void OutputDeleter::operator()(AVFormatContext* object) const noexcept { avformat_free_context(object); }
void CustomIoDeleter::operator()(AVIOContext* object) const noexcept {
  // libav may have replaced the buffer, so the context's own pointer is the one to free.
  av_freep(static_cast<void*>(&object->buffer));
  avio_context_free(&object);
}

namespace {

template <typename Handle>
Handle allocated(Handle handle) {
  if (!handle) {
    throw std::bad_alloc();
  }
  return handle;
}

}  // namespace

Frame make_frame() { return allocated(Frame(av_frame_alloc())); }
Packet make_packet() { return allocated(Packet(av_packet_alloc())); }
Frame reference(const AVFrame& frame) { return allocated(Frame(av_frame_clone(&frame))); }

Options::Options(Options&& other) noexcept : dictionary_(std::exchange(other.dictionary_, nullptr)) {}
Options& Options::operator=(Options&& other) noexcept {
  std::swap(dictionary_, other.dictionary_);
  return *this;
}
Options::~Options() { av_dict_free(&dictionary_); }

void Options::set(const std::string& key, const std::string& value) {
  require(av_dict_set(&dictionary_, key.c_str(), value.c_str(), 0), "cannot set the media option " + key);
}

std::string Options::unused() const {
  const AVDictionaryEntry* entry = av_dict_get(dictionary_, "", nullptr, AV_DICT_IGNORE_SUFFIX);
  return entry == nullptr ? "" : entry->key;
}

std::string libav_error_text(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

void throw_libav(const std::string& what, int code) {
  throw LibavError(what + ": " + libav_error_text(code));
}

int require(int code, const std::string& what) {
  if (code < 0) {
    throw_libav(what, code);
  }
  return code;
}

namespace {

struct Log {
  std::mutex mutex;
  bool routed = false;
  LibavLogSink sink;
  std::string line;      // what was printed since the last line end
  int print_prefix = 1;  // libav's own state: whether the next piece begins a line
};

// Never destroyed: libav's threads may still log while the program's statics go.
Log& log_state() {
  static Log* const instance = new Log;
  return *instance;
}

thread_local LibavComplaints* complaints = nullptr;

void pass_complaint(void* object, int level, const char* format, va_list arguments) {
  std::array<char, 1024> text{};
  int print_prefix = 0;  // which names an address in memory
  av_log_format_line2(object, level, format, arguments, text.data(), static_cast<int>(text.size()),
                      &print_prefix);
  const std::string_view line = text.data();
  complaints->take(line.substr(0, line.find_first_of("\r\n")));
}

void receive(void* object, int level, const char* format, va_list arguments) {
  if ((level & 0xff) > av_log_get_level()) {
    return;
  }
  if (complaints != nullptr && (level & 0xff) <= AV_LOG_ERROR) {
    va_list again;
    va_copy(again, arguments);
    pass_complaint(object, level, format, again);
    va_end(again);
  }
  Log& state = log_state();
  const std::lock_guard lock(state.mutex);
  if (!state.sink) {
    return;
  }
  std::array<char, 1024> text{};
  av_log_format_line2(object, level, format, arguments, text.data(), static_cast<int>(text.size()),
                      &state.print_prefix);
  state.line += text.data();
  for (auto end = state.line.find_first_of("\r\n"); end != std::string::npos;
       end = state.line.find_first_of("\r\n")) {
    if (end > 0) {
      state.sink(level & 0xff, std::string_view(state.line).substr(0, end));
    }
    state.line.erase(0, end + 1);
  }
}

}  // namespace

void route_libav_log(LibavLogSink sink) {
  Log& state = log_state();
  {
    const std::lock_guard lock(state.mutex);
    state.routed = true;
    state.sink = std::move(sink);
    state.line.clear();
  }
  av_log_set_callback(receive);
}

void silence_libav() {
  const std::lock_guard lock(log_state().mutex);
  if (!std::exchange(log_state().routed, true)) {
    av_log_set_callback(receive);
  }
}

LibavComplaints::LibavComplaints() : outer_(std::exchange(complaints, this)) { silence_libav(); }
LibavComplaints::~LibavComplaints() { complaints = outer_; }

void LibavComplaints::take(std::string_view line) {
  if (first_.empty()) {
    first_ = line;
  }
}

}  // namespace kiroku::media
