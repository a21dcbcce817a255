#include "viewer/report/figure.h"

namespace kiroku::report {

const char* ink_hex(Ink ink) {
  switch (ink) {
    case Ink::kGrey:
      return "#6b6b6b";
    case Ink::kPale:
      return "#e4e9ee";
    case Ink::kBlue:
      return "#1f4e79";
    case Ink::kWhite:
      return "#ffffff";
    case Ink::kBlack:
      break;
  }
  return "#111111";
}

}  // namespace kiroku::report
