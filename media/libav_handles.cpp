#include "media/libav_handles.h"

#include <array>
#include <cstdarg>
#include <mutex>
#include <utility>

extern "C" {
#include <libswscale/swscale.h>

#include <libavcodec/avcodec.h>
#include <libavcodec/bsf.h>
#include <libavfilter/avfilter.h>
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
void LibavDeleter::operator()(AVFilterGraph* object) const noexcept { avfilter_graph_free(&object); }
void LibavDeleter::operator()(AVFilterInOut* object) const noexcept { avfilter_inout_free(&object); }
void LibavDeleter::operator()(AVFrame* object) const noexcept { av_frame_free(&object); }
void LibavDeleter::operator()(AVPacket* object) const noexcept { av_packet_free(&object); }
void LibavDeleter::operator()(SwsContext* object) const noexcept { sws_freeContext(object); }
void LibavInputDeleter::operator()(AVFormatContext* object) const noexcept { avformat_close_input(&object); }
void LibavOutputDeleter::operator()(AVFormatContext* object) const noexcept { avformat_free_context(object); }
void LibavCustomIoDeleter::operator()(AVIOContext* object) const noexcept {
  // libav may have replaced the buffer, so the context's own pointer is the one to free.
  av_freep(static_cast<void*>(&object->buffer));
  avio_context_free(&object);
}

Frame new_frame() { return check_allocated(Frame(av_frame_alloc()), "make a video frame"); }
Packet new_packet() { return check_allocated(Packet(av_packet_alloc()), "make a media packet"); }

Options::Options(Options&& other) noexcept : dictionary_(std::exchange(other.dictionary_, nullptr)) {}
Options& Options::operator=(Options&& other) noexcept {
  std::swap(dictionary_, other.dictionary_);
  return *this;
}
Options::~Options() { av_dict_free(&dictionary_); }

void Options::set(const std::string& key, const std::string& value) {
  check_libav(av_dict_set(&dictionary_, key.c_str(), value.c_str(), 0), "set the media option " + key);
}

std::string Options::first_left() const {
  const AVDictionaryEntry* entry = av_dict_get(dictionary_, "", nullptr, AV_DICT_IGNORE_SUFFIX);
  return entry == nullptr ? "" : entry->key;
}

std::string libav_error_text(int code) {
  std::array<char, AV_ERROR_MAX_STRING_SIZE> text{};
  av_strerror(code, text.data(), text.size());
  return text.data();
}

void throw_libav(std::string_view action, int code) {
  throw Error("cannot " + std::string(action) + ": " + libav_error_text(code));
}

int check_libav(int code, std::string_view action) {
  if (code < 0) {
    throw_libav(action, code);
  }
  return code;
}

void throw_out_of_memory(std::string_view action) {
  throw Error("cannot " + std::string(action) + ": out of memory");
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

void receive(void* object, int level, const char* format, va_list arguments) {
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

void quiet_libav() {
  const std::lock_guard lock(log_state().mutex);
  if (!std::exchange(log_state().routed, true)) {
    av_log_set_callback(receive);
  }
}

}  // namespace kiroku::media
