// Pictures in memory that two sides share, one of which may be hostile.
#include "media/box/picture_memory.h"

#include <algorithm>
#include <functional>
#include <map>
#include <unistd.h>

extern "C" {
#include <libavutil/frame.h>
#include <libavutil/pixdesc.h>
}

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::media {
namespace {

class PictureMemoryTest : public testing::Test {
 protected:
  static Frame picture(int width, int height, int value, AVPixelFormat format = AV_PIX_FMT_YUV420P) {
    Frame frame = make_frame();
    frame->width = width;
    frame->height = height;
    frame->format = format;
    require(av_frame_get_buffer(frame.get(), 0), "make a picture");
    for (int line = 0; line < height; ++line)
      std::fill_n(frame->data[0] + line * frame->linesize[0], width, static_cast<std::uint8_t>(value));
    return frame;
  }
  PictureNote handed_out(const AVFrame& frame) {
    PictureNote note;
    EXPECT_TRUE(lender_.hand_out(frame, note));
    return note;
  }
  static int value_of(const AVFrame& frame) {
    return frame.data[0][(frame.height - 1) * frame.linesize[0] + frame.width - 1];
  }

  const Descriptor memory_ = make_shared_memory(kPictureMemoryBytes);
  PictureLender lender_{memory_.number()};
  const std::shared_ptr<PictureBorrower> borrower_ = std::make_shared<PictureBorrower>(memory_.number());
};

TEST_F(PictureMemoryTest, APictureArrivesAsItIs) {
  Frame sent = picture(65, 47, 200, AV_PIX_FMT_YUV422P10LE);
  sent->sample_aspect_ratio = {4, 3};
  sent->color_range = AVCOL_RANGE_JPEG;
  sent->colorspace = AVCOL_SPC_BT709;
  sent->chroma_location = AVCHROMA_LOC_LEFT;
  const Frame got = borrower_->borrow(handed_out(*sent));
  EXPECT_EQ(got->width, 65);
  EXPECT_EQ(got->height, 47);
  EXPECT_EQ(got->format, AV_PIX_FMT_YUV422P10LE);
  EXPECT_EQ(got->sample_aspect_ratio.num, 4);
  EXPECT_EQ(got->color_range, AVCOL_RANGE_JPEG);
  EXPECT_EQ(got->colorspace, AVCOL_SPC_BT709);
  EXPECT_EQ(got->chroma_location, AVCHROMA_LOC_LEFT);
  for (int line = 0; line < 47; ++line) {
    EXPECT_TRUE(std::equal(got->data[0] + line * got->linesize[0],
                           got->data[0] + line * got->linesize[0] + 65,
                           sent->data[0] + line * sent->linesize[0]))
        << line;
  }
}

TEST_F(PictureMemoryTest, WhatIsHeldIsNotWrittenOverAndWhatIsLetGoIsUsedAgain) {
  std::vector<PictureNote> notes;
  std::vector<Frame> held;
  for (int i = 0; i < 20; ++i) {
    notes.push_back(handed_out(*picture(640, 480, i)));
    held.push_back(borrower_->borrow(notes.back()));
  }
  for (int i = 0; i < 20; ++i) EXPECT_EQ(value_of(*held[static_cast<std::size_t>(i)]), i);
  held.clear();
  EXPECT_EQ(handed_out(*picture(640, 480, 99)).begin, notes.front().begin);
}

TEST_F(PictureMemoryTest, AReferenceHoldsThePlaceUntilTheLastIsGone) {
  const PictureNote first = handed_out(*picture(64, 48, 1));
  Frame got = borrower_->borrow(first);
  Frame reference = media::reference(*got);
  got.reset();
  EXPECT_NE(handed_out(*picture(64, 48, 2)).begin, first.begin);
  EXPECT_EQ(value_of(*reference), 1);
  reference.reset();
  EXPECT_EQ(handed_out(*picture(64, 48, 3)).begin, first.begin);
}

TEST_F(PictureMemoryTest, WhereThereIsNoRoomThePictureIsLostAndComesBackWithRoom) {
  std::vector<Frame> held;
  PictureNote note;
  const Frame large = picture(8192, 8192, 5);  // 96 MiB
  for (int i = 0; i < 20 && lender_.hand_out(*large, note); ++i) held.push_back(borrower_->borrow(note));
  EXPECT_EQ(held.size(), kPictureMemoryBytes / (8192U * 8192 * 3 / 2));
  EXPECT_FALSE(lender_.hand_out(*large, note));
  held.clear();
  EXPECT_TRUE(lender_.hand_out(*large, note));
}

TEST_F(PictureMemoryTest, PicturesOfOtherSizesTakeTheRoomOfThoseThatAreGone) {
  for (const int side : {16'000, 4000, 16'000, 700, 16'000}) {
    for (int i = 0; i < 3; ++i) {
      const Frame got = borrower_->borrow(handed_out(*picture(side, side / 2, i)));
      EXPECT_EQ(value_of(*got), i);
    }
  }
}

TEST_F(PictureMemoryTest, NobodyWritesToABorrowedPicture) {
  const Frame got = borrower_->borrow(handed_out(*picture(64, 48, 1)));
  EXPECT_FALSE(av_frame_is_writable(got.get()));
  EXPECT_DEATH(got->data[0][0] = 1, "");
}

TEST_F(PictureMemoryTest, NoNoteLeadsOutOfTheMemory) {
  const PictureNote good = handed_out(*picture(64, 48, 1));
  const std::map<std::string, std::function<void(PictureNote&)>> lies{
      {"a place that is none", [](PictureNote& note) { note.place = kMostPlaces; }},
      {"the first page", [](PictureNote& note) { note.begin = note.planes[0] = 0; }},
      {"behind the end", [](PictureNote& note) { note.begin = kPictureMemoryBytes; }},
      {"more than there is", [](PictureNote& note) { note.bytes = kPictureMemoryBytes; }},
      {"a sum that overflows", [](PictureNote& note) { note.bytes = UINT64_MAX; }},
      {"a beginning that overflows", [](PictureNote& note) { note.begin = UINT64_MAX - 64; }},
      {"a plane before its place", [](PictureNote& note) { note.planes[1] = note.begin - 1; }},
      {"a plane that ends behind its place",
       [](PictureNote& note) { note.planes[2] = note.begin + note.bytes - 1; }},
      {"a plane nowhere", [](PictureNote& note) { note.planes[0] = UINT64_MAX; }},
      {"lines shorter than the picture", [](PictureNote& note) { note.line_bytes[0] = 63; }},
      {"lines that go backwards", [](PictureNote& note) { note.line_bytes[0] = -64; }},
      {"lines without end", [](PictureNote& note) { note.line_bytes[0] = INT32_MAX; }},
      {"no width", [](PictureNote& note) { note.width = 0; }},
      {"a negative height", [](PictureNote& note) { note.height = -1; }},
      {"a height behind its place", [](PictureNote& note) { note.height = 16'000; }},
      {"a size that overflows", [](PictureNote& note) { note.width = note.height = INT32_MAX; }},
      {"a format that is none", [](PictureNote& note) { note.format = 100'000; }},
      {"a picture in a graphics card", [](PictureNote& note) { note.format = AV_PIX_FMT_VAAPI; }},
      {"another format", [](PictureNote& note) { note.format = AV_PIX_FMT_RGBA64LE; }},
  };
  for (const auto& [what, lie] : lies) {
    PictureNote note = good;
    lie(note);
    EXPECT_THROW((void)borrower_->borrow(note), Error) << what;
  }
  EXPECT_EQ(value_of(*borrower_->borrow(good)), 1);
}

TEST_F(PictureMemoryTest, ColoursThatDoNotExistAreUnknown) {
  PictureNote note = handed_out(*picture(64, 48, 1));
  note.range = note.primaries = note.transfer = note.matrix = note.chroma_location = 1'000'000;
  note.aspect_numerator = -3;
  const Frame got = borrower_->borrow(note);
  EXPECT_EQ(got->color_range, AVCOL_RANGE_UNSPECIFIED);
  EXPECT_EQ(got->color_primaries, AVCOL_PRI_UNSPECIFIED);
  EXPECT_EQ(got->colorspace, AVCOL_SPC_UNSPECIFIED);
  EXPECT_EQ(got->sample_aspect_ratio.num, 0);
}

TEST_F(PictureMemoryTest, TheMemoryKeepsItsSize) {
  EXPECT_NE(::ftruncate(memory_.number(), 4096), 0);
  EXPECT_NE(::ftruncate(memory_.number(), static_cast<off_t>(2 * kPictureMemoryBytes)), 0);
}

}  // namespace
}  // namespace kiroku::media
