#include "sim/volume/jpeg2000.h"

#include <algorithm>
#include <array>
#include <memory>
#include <openjpeg.h>

#include "base/error.h"

namespace kiroku::sim {
namespace {

struct CodecDeleter {
  void operator()(opj_codec_t* codec) const { opj_destroy_codec(codec); }
};
struct StreamDeleter {
  void operator()(opj_stream_t* stream) const { opj_stream_destroy(stream); }
};
struct ImageDeleter {
  void operator()(opj_image_t* image) const { opj_image_destroy(image); }
};

/// What the library reads from, through its callbacks.
struct Source {
  ByteView bytes;
  std::size_t at = 0;
};

OPJ_SIZE_T read_some(void* buffer, OPJ_SIZE_T wanted, void* user) {
  auto& source = *static_cast<Source*>(user);
  const std::size_t count = std::min<std::size_t>(wanted, source.bytes.size() - source.at);
  if (count == 0) return static_cast<OPJ_SIZE_T>(-1);
  std::copy_n(source.bytes.data() + source.at, count, static_cast<std::byte*>(buffer));
  source.at += count;
  return count;
}

OPJ_OFF_T skip_some(OPJ_OFF_T wanted, void* user) {
  auto& source = *static_cast<Source*>(user);
  if (wanted < 0) return -1;
  const std::size_t count =
      std::min<std::size_t>(static_cast<std::size_t>(wanted), source.bytes.size() - source.at);
  source.at += count;
  return static_cast<OPJ_OFF_T>(count);
}

OPJ_BOOL seek_to(OPJ_OFF_T offset, void* user) {
  auto& source = *static_cast<Source*>(user);
  if (offset < 0 || static_cast<std::size_t>(offset) > source.bytes.size()) return OPJ_FALSE;
  source.at = static_cast<std::size_t>(offset);
  return OPJ_TRUE;
}

}  // namespace

std::vector<std::int32_t> decode_jpeg2000(ByteView encoded, std::size_t columns, std::size_t rows,
                                          const std::string& what) {
  constexpr std::array<std::byte, 4> kJp2Begins{std::byte{0}, std::byte{0}, std::byte{0}, std::byte{12}};
  const bool is_jp2 = encoded.size() >= 4 && std::ranges::equal(encoded.first(4), kJp2Begins);
  const std::unique_ptr<opj_codec_t, CodecDeleter> codec(
      opj_create_decompress(is_jp2 ? OPJ_CODEC_JP2 : OPJ_CODEC_J2K));
  const std::unique_ptr<opj_stream_t, StreamDeleter> stream(opj_stream_default_create(OPJ_TRUE));
  Source source{encoded};
  opj_stream_set_user_data(stream.get(), &source, nullptr);
  opj_stream_set_user_data_length(stream.get(), encoded.size());
  opj_stream_set_read_function(stream.get(), read_some);
  opj_stream_set_skip_function(stream.get(), skip_some);
  opj_stream_set_seek_function(stream.get(), seek_to);
  opj_dparameters_t parameters;
  opj_set_default_decoder_parameters(&parameters);
  opj_image_t* header = nullptr;
  const bool begun = opj_setup_decoder(codec.get(), &parameters) == OPJ_TRUE &&
                     opj_read_header(stream.get(), codec.get(), &header) == OPJ_TRUE;
  const std::unique_ptr<opj_image_t, ImageDeleter> image(header);
  if (!begun || image == nullptr)
    throw Error(what + ": its JPEG 2000 picture cannot be read: the header is damaged");
  // Before memory for the picture is asked for.
  if (image->numcomps != 1 || image->comps[0].w != columns || image->comps[0].h != rows) {
    throw Error(what + ": its JPEG 2000 picture is not the one grey picture of " + std::to_string(columns) +
                " x " + std::to_string(rows) + " pixels that the file says");
  }
  if (opj_decode(codec.get(), stream.get(), image.get()) != OPJ_TRUE || image->comps[0].data == nullptr) {
    throw Error(what + ": its JPEG 2000 picture is damaged or cut off");
  }
  return {image->comps[0].data, image->comps[0].data + columns * rows};
}

}  // namespace kiroku::sim
