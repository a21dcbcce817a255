// A picture of the plan and one of the recording as one. Objects belong to one thread.
#pragma once

#include <string>
#include <vector>

#include "sim/render/lettering.h"
#include "sim/render/picture.h"

namespace kiroku::compare {

enum class Arrangement {
  kSideBySide,  // the plan left, the recording right
  kOverlay,     // the plan's tissue and tools over the recording
  kWipe,        // the plan left of a line, the recording right of it
};

struct CompositionForm {
  Arrangement arrangement = Arrangement::kSideBySide;
  int width = 0, height = 0;             // of each of the two pictures; even
  double share = 0.5;                    // of overlay: the plan's opacity; of wipe: where the line is, 0 to 1
  sim::Rgb plan_background{18, 20, 24};  // what of the plan's picture is none of it
  std::vector<std::string> cautions;     // above everything, in every picture: provenance.h
  /// Of an organ that is deformed to fit: colours say how far it departs from the plan, else from rest.
  bool from_plan = false;
};

/// What stands around the pictures.
struct Caption {
  std::string plan, recording;  // above them: the times
  std::string step, vitals;     // below
  double displacement_mm = 0;   // beside the pictures' right border: what the last colour of a displacement
                                // stands for; 0 for no scale
  std::string scale_title = "mm";  // above that
};

class Composer {
 public:
  /// kiroku::Error where the font is missing.
  explicit Composer(const CompositionForm& form);

  /// Of all pictures; even.
  [[nodiscard]] int width() const;
  [[nodiscard]] int height() const;
  /// Both of the form's size.
  sim::Picture compose(const sim::Picture& plan, const sim::Picture& recording, const Caption& caption);
  /// What is put together already, as wide as the whole and as high as the form.
  sim::Picture frame(const sim::Picture& pictures, const Caption& caption);

 private:
  void lay(const sim::Picture& plan, const sim::Picture& recording, sim::Picture& into) const;

  CompositionForm form_;
  sim::Lettering lettering_;
  std::vector<std::string> cautions_;  // in lines that fit
};

}  // namespace kiroku::compare
