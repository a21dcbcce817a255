#include "trainer/report/plot.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::trainer {
namespace {

std::string text_of(const Bytes& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Plot plot() {
  return {"Thresholds",
          "fingers",
          "Hz",
          {{"measured", {1, 2, 3}, {23.1, 8.9, 3.1}, {{20, 26}, {8, 10}, {2.5, 3.8}}, true},
           {"paper", {1, 2, 3}, {23.3, 8.8, 3.0}, {}, false}},
          true,
          true,
          "simulated"};
}

TEST(Plot, ComesInThreeForms) {
  EXPECT_EQ(plot_form("a/b.svg"), PlotForm::kSvg);
  EXPECT_EQ(plot_form("b.pdf"), PlotForm::kPdf);
  EXPECT_THROW((void)plot_form("b.jpg"), UsageError);
  EXPECT_THAT(text_of(plot_file(plot(), PlotForm::kSvg)), testing::HasSubstr("<svg"));
  EXPECT_THAT(text_of(plot_file(plot(), PlotForm::kPdf)), testing::StartsWith("%PDF"));
  EXPECT_THAT(text_of(plot_file(plot(), plot_form("x.png"))), testing::StartsWith("\x89PNG"));
  EXPECT_EQ(plot_file(plot(), PlotForm::kPng), plot_file(plot(), PlotForm::kPng));
}

TEST(Plot, DrawsWhatItIsGiven) {
  // Something else is drawn for other numbers, another scale, another note.
  const Bytes first = plot_file(plot(), PlotForm::kPng);
  Plot other = plot();
  other.series[0].y[1] = 12;
  EXPECT_NE(plot_file(other, PlotForm::kPng), first);
  other = plot();
  other.logarithmic_y = false;
  EXPECT_NE(plot_file(other, PlotForm::kPng), first);
  other = plot();
  other.note = "measured";
  EXPECT_NE(plot_file(other, PlotForm::kPng), first);
  EXPECT_FALSE(plot_file({"nothing", "x", "y", {}, true, true, ""}, PlotForm::kPng).empty());
  EXPECT_FALSE(
      plot_file({"one", "x", "y", {{"a", {3}, {0}, {}, true}}, false, true, ""}, PlotForm::kPng).empty());
}

TEST(Plot, RefusesWhatCannotBeDrawn) {
  Plot wrong = plot();
  wrong.series[0].y[0] = -1;  // on a logarithmic axis
  EXPECT_THROW(plot_file(wrong, PlotForm::kSvg), UsageError);
  wrong = plot();
  wrong.series[0].x.pop_back();
  EXPECT_THROW(plot_file(wrong, PlotForm::kSvg), UsageError);
  wrong = plot();
  wrong.series[1].y[2] = std::numeric_limits<double>::infinity();
  EXPECT_THROW(report_pdf("x", {{"", "", {}, wrong}}), UsageError);
}

TEST(Report, HasAsManyPagesAsItNeeds) {
  std::vector<ReportBlock> blocks{{"Results", "Nothing was measured.", {{"a", "b"}, {"1", "2"}}, plot()}};
  const auto pages = [](const Bytes& pdf) {
    const std::string text = text_of(pdf);
    std::size_t count = 0;
    for (std::size_t at = text.find("/Type /Page "); at != std::string::npos;
         at = text.find("/Type /Page ", at + 1))
      ++count;
    return count;
  };
  EXPECT_EQ(pages(report_pdf("Training", blocks)), 1U);
  for (int i = 0; i < 4; ++i) blocks.push_back(blocks[0]);
  EXPECT_EQ(pages(report_pdf("Training", blocks)), 3U);
}

}  // namespace
}  // namespace kiroku::trainer
