#include "recorder/source/source_address.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

TEST(SourceAddress, RemovesPasswordsFromWhatIsStated) {
  EXPECT_EQ(parse_source_address("rtsp://user:secret@10.0.0.7:554/stream").stated,
            "rtsp://user:***@10.0.0.7:554/stream");
  EXPECT_EQ(parse_source_address("rtsp://user:p@ss/w@host/x").stated, "rtsp://user:***@host/x");
  EXPECT_EQ(parse_source_address("srt://host:9000?mode=caller&passphrase=0123456789&latency=200").stated,
            "srt://host:9000?mode=caller&passphrase=***&latency=200");
  EXPECT_EQ(parse_source_address("rtsp://host:554/x").stated, "rtsp://host:554/x");
  EXPECT_EQ(parse_source_address("mllp://0.0.0.0:2575?allow=10.0.0.8&sender=ICU").stated,
            "mllp://0.0.0.0:2575?allow=10.0.0.8&sender=ICU");
}

// As makers of cameras write them.
TEST(SourceAddress, StatesNothingThatMayOpenACamera) {
  const auto stated = [](const std::string& text) {
    return parse_source_address(text, Presence::kNotLookedAt).stated;
  };
  EXPECT_EQ(stated("http://cam/v.mjpg?user=viewer&pw=SECRET&pass=SECRET&access_token=SECRET&fps=25"),
            "http://cam/v.mjpg?user=***&pw=***&pass=***&access_token=***&fps=25");
  EXPECT_EQ(stated("http://cam/v?usr=a;pwd=SECRET"), "http://cam/v?usr=***;pwd=***");
  EXPECT_EQ(stated("https://cam/v?SECRET"), "https://cam/v?***");
  EXPECT_EQ(stated("http://SECRET@cam/v"), "http://***@cam/v");
  EXPECT_EQ(stated("http://cam:81/user=admin_password=SECRET_channel=1.ts"), "http://cam:81/user=***");
  EXPECT_EQ(stated("rtsp://cam/user=admin&password=SECRET/1/main"), "rtsp://cam/user=***/1/main");
  EXPECT_EQ(stated("rtsp://cam/Channels/101?Channel=1&Resolution=hd"),
            "rtsp://cam/Channels/101?Channel=1&Resolution=hd");
  EXPECT_EQ(stated("udp://@239.0.0.1:5000?ttl=4"), "udp://@239.0.0.1:5000?ttl=4");
}

TEST(SourceAddress, KeepsTheWholeAddressForTheNetwork) {
  const SourceAddress address = parse_source_address("srt://host:9000?mode=caller&passphrase=0123456789");
  EXPECT_EQ(address.kind, SourceKind::kNetwork);
  EXPECT_EQ(address.location, "srt://host:9000?mode=caller&passphrase=0123456789");
}

TEST(SourceAddress, LetsTheSchemeOfRtspChooseTheTransport) {
  const SourceAddress address = parse_source_address("rtsp+udp://user:secret@host/x?channel=1");
  EXPECT_EQ(address.kind, SourceKind::kNetwork);
  EXPECT_EQ(address.location, "rtsp://user:secret@host/x?channel=1");
  EXPECT_EQ(address.option("transport", ""), "udp");
  EXPECT_EQ(address.stated, "rtsp+udp://user:***@host/x?channel=1");
  EXPECT_EQ(parse_source_address("rtsp://host/x").option("transport", "any"), "any");
  EXPECT_THROW(parse_source_address("rtsp+pigeon://host/x"), UsageError);
  EXPECT_THROW(parse_source_address("srt+udp://host/x"), UsageError);
}

TEST(SourceAddress, SplitsOptionsOfSyntheticSources) {
  const SourceAddress address = parse_source_address("synthetic:room?size=64x48&rate=10&speed=max");
  EXPECT_EQ(address.kind, SourceKind::kSynthetic);
  EXPECT_EQ(address.location, "room");
  EXPECT_EQ(address.option("size", ""), "64x48");
  EXPECT_EQ(integer_option(address, "rate", 25, 1, 240), 10);
  EXPECT_TRUE(address.unpaced());
}

TEST(SourceAddress, RefusesWhatIsNotThere) {
  EXPECT_THROW(parse_source_address(""), UsageError);
  EXPECT_THROW(parse_source_address("/nowhere/film.mp4"), UsageError);
  EXPECT_THROW(parse_source_address("gopher://host/film"), UsageError);
  EXPECT_THROW(parse_source_address(std::filesystem::temp_directory_path().string()), UsageError);
}

TEST(SourceAddress, TakesAFileWhoseNameHasAQuestionMark) {
  const auto file = std::filesystem::temp_directory_path() / "kiroku-what?.ts";
  std::ofstream(file) << "x";
  const SourceAddress address = parse_source_address(file.string());
  EXPECT_EQ(address.kind, SourceKind::kFile);
  EXPECT_EQ(address.location, file.string());
  EXPECT_EQ(parse_source_address(file.string() + "?loop=1").option("loop", "0"), "1");
  std::filesystem::remove(file);
}

TEST(SourceAddress, RefusesNumbersOutOfBounds) {
  const SourceAddress address = parse_source_address("synthetic:room?rate=0&flash=x");
  EXPECT_THROW((void)integer_option(address, "rate", 25, 1, 240), UsageError);
  EXPECT_THROW((void)integer_option(address, "flash", 0, 0, 10), UsageError);
}

}  // namespace
}  // namespace kiroku::recorder
