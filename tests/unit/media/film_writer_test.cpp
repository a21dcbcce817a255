#include "media/film_writer.h"

#include <cmath>
#include <fstream>
#include <iterator>
#include <malloc.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include "base/error.h"
#include "media/libav_handles.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::media {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 96, kHeight = 64;

/// A picture whose every pixel depends on where it is and on the number.
std::vector<std::uint8_t> pattern(int number, int channels = 3) {
  std::vector<std::uint8_t> samples;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < channels; ++c)
        samples.push_back(static_cast<std::uint8_t>((x * 2 + y * (c + 1) + number * 7 + c * 40) % 256));
    }
  }
  return samples;
}

struct Film {
  std::string codec, pixel_format;
  double seconds_per_frame = 0;
  std::vector<std::vector<std::uint8_t>> pictures;  // as RGB or grey
};

/// What a player gets of it; colours of 4:2:0 are left as their first plane alone.
Film decode(const std::string& file) {
  AVFormatContext* raw = nullptr;
  require(avformat_open_input(&raw, file.c_str(), nullptr, nullptr), "open");
  const InputContext input(raw);
  require(avformat_find_stream_info(input.get(), nullptr), "probe");
  const AVStream& stream = *input->streams[0];
  Film film;
  film.codec = avcodec_get_name(stream.codecpar->codec_id);
  film.seconds_per_frame = av_q2d(av_inv_q(stream.avg_frame_rate));
  const Codec decoder(avcodec_alloc_context3(avcodec_find_decoder(stream.codecpar->codec_id)));
  require(avcodec_parameters_to_context(decoder.get(), stream.codecpar), "decode");
  require(avcodec_open2(decoder.get(), nullptr, nullptr), "decode");
  const Packet packet = make_packet();
  const Frame frame = make_frame();
  const auto receive = [&] {
    while (avcodec_receive_frame(decoder.get(), frame.get()) >= 0) {
      const bool colour = frame->format == AV_PIX_FMT_BGR0;
      film.pixel_format = colour ? "bgr0" : frame->format == AV_PIX_FMT_GRAY8 ? "gray" : "yuv";
      std::vector<std::uint8_t> samples;
      for (int y = 0; y < frame->height; ++y) {
        const std::uint8_t* row = frame->data[0] + std::ptrdiff_t{y} * frame->linesize[0];
        for (int x = 0; x < frame->width; ++x) {
          if (colour) {
            samples.insert(samples.end(), {row[4 * x + 2], row[4 * x + 1], row[4 * x]});
          } else {
            samples.push_back(row[x]);
          }
        }
      }
      film.pictures.push_back(std::move(samples));
    }
  };
  while (av_read_frame(input.get(), packet.get()) >= 0) {
    require(avcodec_send_packet(decoder.get(), packet.get()), "decode");
    av_packet_unref(packet.get());
    receive();
  }
  require(avcodec_send_packet(decoder.get(), nullptr), "decode");
  receive();
  return film;
}

std::string bytes_of_file(const std::filesystem::path& file) {
  std::ifstream input(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(input), {}};
}

class FilmWriterTest : public testing::Test {
 protected:
  std::string write(const std::string& name, int frames, const FilmFormat& format, bool overwrite = false) {
    FilmWriter film(folder_ / name, format, overwrite);
    for (int i = 0; i < frames; ++i)
      film.add({kWidth, kHeight, format.channels, pattern(i, format.channels)});
    film.finish();
    return (folder_ / name).string();
  }
  std::string refusal(const std::string& name, const FilmFormat& format, bool overwrite = false) {
    try {
      write(name, 1, format, overwrite);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  test::TemporaryFolder folder_;
  FilmFormat format_{kWidth, kHeight, 3, 20, 1};
  FilmFormat grey_{kWidth, kHeight, 1, 20, 1};
};

TEST_F(FilmWriterTest, GivesPicturesBackBitForBitFromMatroska) {
  const Film film = decode(write("film.mkv", 5, format_));
  EXPECT_EQ(film.codec, "ffv1");
  EXPECT_EQ(film.pixel_format, "bgr0");
  EXPECT_NEAR(film.seconds_per_frame, 0.05, 1e-4);
  ASSERT_EQ(film.pictures.size(), 5U);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(film.pictures[static_cast<std::size_t>(i)], pattern(i)) << i;
}

TEST_F(FilmWriterTest, GivesGreyPicturesBackBitForBit) {
  const Film film = decode(write("film.mkv", 3, grey_));
  EXPECT_EQ(film.pixel_format, "gray");
  ASSERT_EQ(film.pictures.size(), 3U);
  EXPECT_EQ(film.pictures[2], pattern(2, 1));
}

TEST_F(FilmWriterTest, WritesH264ThatKeepsEveryPictureInItsPlace) {
  const Film film = decode(write("film.mp4", 12, format_));
  EXPECT_EQ(film.codec, "h264");
  EXPECT_EQ(film.pixel_format, "yuv");
  EXPECT_NEAR(film.seconds_per_frame, 0.05, 1e-4);
  ASSERT_EQ(film.pictures.size(), 12U);
  for (int i = 0; i < 12; ++i) {
    // Luma of BT.709 in limited range, within what compression leaves of it.
    const std::vector<std::uint8_t> rgb = pattern(i);
    double sum = 0;
    for (std::size_t p = 0; p < film.pictures[0].size(); ++p) {
      const double luma = 0.2126 * rgb[3 * p] + 0.7152 * rgb[3 * p + 1] + 0.0722 * rgb[3 * p + 2];
      sum += std::abs(16 + luma * 219 / 255 - film.pictures[static_cast<std::size_t>(i)][p]);
    }
    EXPECT_LT(sum / static_cast<double>(film.pictures[0].size()), 3) << i;
  }
}

TEST_F(FilmWriterTest, WritesPicturesIntoAFolder) {
  write("frames", 3, format_);
  for (int i = 0; i < 3; ++i) {
    const auto file = folder_ / "frames" / ("00000" + std::to_string(i + 1) + ".png");
    const Bytes png = png_of({kWidth, kHeight, 3, pattern(i)});
    EXPECT_EQ(bytes_of_file(file), text_of(png)) << i;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "frames.part"));
}

TEST_F(FilmWriterTest, GivesTheSameBytesWhateverWasInMemoryBefore) {
  for (const std::string ending : {".mkv", ".mp4"}) {
    mallopt(M_PERTURB, 1);
    const auto one = bytes_of_file(write("one" + ending, 30, format_));
    mallopt(M_PERTURB, 77);
    const auto two = bytes_of_file(write("two" + ending, 30, format_));
    mallopt(M_PERTURB, 0);
    EXPECT_EQ(one, two) << ending;
  }
}

TEST_F(FilmWriterTest, LeavesNothingBehindOfAFilmThatIsNotFinished) {
  for (const std::string name : {"film.mkv", "film.mp4", "frames"}) {
    {
      FilmWriter film(folder_ / name, format_);
      film.add({kWidth, kHeight, 3, pattern(0)});
    }
    EXPECT_TRUE(std::filesystem::is_empty(folder_ / "")) << name;
  }
}

TEST_F(FilmWriterTest, ReplacesWhatIsThereOnlyWhenTold) {
  for (const std::string name : {"film.mkv", "frames"}) {
    write(name, 4, format_);
    EXPECT_THAT(refusal(name, format_), HasSubstr("--force")) << name;
    write(name, 2, format_, true);
  }
  EXPECT_EQ(decode((folder_ / "film.mkv").string()).pictures.size(), 2U);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "frames/000003.png")) << "of the film before";
}

TEST_F(FilmWriterTest, NeverReplacesAFolderOfOtherThings) {
  std::filesystem::create_directory(folder_ / "frames");
  std::ofstream(folder_ / "frames/thesis.tex") << "years of work";
  EXPECT_THAT(refusal("frames", format_, true), HasSubstr("holds other things than pictures"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "frames/thesis.tex"));
}

TEST_F(FilmWriterTest, RefusesWhatCannotBeAFilm) {
  EXPECT_THAT(refusal("film.avi", format_), HasSubstr("must end in .mp4 (H.264) or .mkv"));
  EXPECT_THAT(refusal("film.mp4", {95, 64, 3, 20, 1}), HasSubstr("sides must be even"));
  EXPECT_THAT(refusal("film.mkv", {0, 64, 3, 20, 1}), HasSubstr("0x64"));
  EXPECT_THAT(refusal("film.mkv", {kWidth, kHeight, 3, 0, 1}), HasSubstr("0/1 pictures a second"));
  EXPECT_THAT(refusal("film.mkv", {kWidth, 32, 3, 20, 1}), HasSubstr("must all be alike"));
  EXPECT_THROW(FilmWriter(folder_ / "film.mkv", format_).finish(), Error);
}

TEST(Png, RefusesSamplesThatAreNoPicture) {
  const std::vector<std::uint8_t> few(5);
  EXPECT_THROW(png_of({2, 1, 3, few}), Error);
  EXPECT_THROW(png_of({5, 1, 2, few}), Error);
  EXPECT_NO_THROW(png_of({5, 1, 1, few}));
}

}  // namespace
}  // namespace kiroku::media
