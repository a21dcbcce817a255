#include "viewer/compare/composition.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace kiroku::compare {
namespace {

constexpr sim::Rgb kPaper{10, 11, 13}, kInk{236, 238, 240}, kFaint{150, 156, 164}, kCaution{255, 176, 64};
constexpr int kGap = 8;

/// A 26th of a picture's height, for people who sit before a screen.
int letters(const CompositionForm& form) {
  constexpr int kShare = 26, kLeast = 13;
  return std::max(kLeast, form.height / kShare);
}

/// A line's height; even.
int line(const CompositionForm& form) { return letters(form) * 9 / 10 * 2; }

}  // namespace

Composer::Composer(const CompositionForm& form) : form_(form) {
  const int size = letters(form_), room = width() - size;
  for (const std::string& caution : form_.cautions) {
    std::istringstream words(caution);
    std::string text;
    for (std::string word; words >> word;) {
      const std::string longer = text.empty() ? word : text + " " + word;
      if (!text.empty() && lettering_.width_of(longer, size) > room) {
        cautions_.push_back(text);
        text = word;
      } else {
        text = longer;
      }
    }
    cautions_.push_back(text);
  }
}

int Composer::width() const {
  return form_.arrangement == Arrangement::kSideBySide ? 2 * form_.width + kGap : form_.width;
}

int Composer::height() const { return form_.height + (3 + static_cast<int>(cautions_.size())) * line(form_); }

sim::Picture Composer::compose(const sim::Picture& plan, const sim::Picture& recording,
                               const Caption& caption) {
  sim::Picture pictures(width(), form_.height);
  for (std::size_t i = 0; i < pictures.rgb.size(); ++i) pictures.rgb[i] = kPaper[i % 3];
  lay(plan, recording, pictures);
  if (caption.displacement_mm > 0)
    sim::draw_displacement_scale(lettering_, pictures, letters(form_), caption.displacement_mm,
                                 caption.scale_title);
  return frame(pictures, caption);
}

sim::Picture Composer::frame(const sim::Picture& pictures, const Caption& caption) {
  sim::Picture whole(width(), height());
  for (std::size_t i = 0; i < whole.rgb.size(); ++i) whole.rgb[i] = kPaper[i % 3];
  const int size = letters(form_), high = line(form_), margin = size / 2;
  const int above = static_cast<int>(cautions_.size()) * high;
  std::ranges::copy(pictures.rgb, whole.pixel(0, above + high));
  const auto write = [&](const std::string& text, int left, int row, const sim::Rgb& colour) {
    lettering_.draw(whole, text, left, row + (high + size * 3 / 4) / 2, size, colour);
  };
  const bool apart = form_.arrangement == Arrangement::kSideBySide;
  for (std::size_t i = 0; i < cautions_.size(); ++i)
    write(cautions_[i], margin, static_cast<int>(i) * high, kCaution);
  write(caption.plan, margin, above, kInk);
  const int right =
      apart ? form_.width + kGap + margin : width() - margin - lettering_.width_of(caption.recording, size);
  write(caption.recording, right, above, kInk);
  write(caption.step, margin, above + high + form_.height, kInk);
  write(caption.vitals, margin, above + 2 * high + form_.height, kFaint);
  return whole;
}

void Composer::lay(const sim::Picture& plan, const sim::Picture& recording, sim::Picture& into) const {
  const auto put = [&](const std::uint8_t* from, int x, int y) { std::copy_n(from, 3, into.pixel(x, y)); };
  const int border = static_cast<int>(std::lround(form_.share * form_.width));
  for (int y = 0; y < form_.height; ++y) {
    for (int x = 0; x < form_.width; ++x) {
      const std::uint8_t *const planned = plan.pixel(x, y), *const recorded = recording.pixel(x, y);
      switch (form_.arrangement) {
        case Arrangement::kSideBySide:
          put(planned, x, y);
          put(recorded, form_.width + kGap + x, y);
          break;
        case Arrangement::kOverlay: {
          const bool shown = !std::equal(planned, planned + 3, form_.plan_background.begin());
          const double share = shown ? form_.share : 0;
          for (int c = 0; c < 3; ++c) {
            into.pixel(x, y)[c] =
                static_cast<std::uint8_t>(std::lround(share * planned[c] + (1 - share) * recorded[c]));
          }
          break;
        }
        case Arrangement::kWipe:
          put(x < border ? planned : x == border ? kInk.data() : recorded, x, y);
          break;
      }
    }
  }
}

}  // namespace kiroku::compare
