#include "viewer/report/qr_figure.h"

#include <memory>
#include <qrencode.h>
#include <utility>

#include "base/error.h"

namespace kiroku::report {
namespace {

struct FreeCode {
  void operator()(QRcode* code) const { QRcode_free(code); }
};

}  // namespace

Figure qr_figure(std::string_view bytes, double side, std::string description) {
  const std::unique_ptr<QRcode, FreeCode> code(QRcode_encodeData(
      static_cast<int>(bytes.size()), reinterpret_cast<const unsigned char*>(bytes.data()), 0, QR_ECLEVEL_M));
  if (!code) {
    throw Error("cannot make a QR code of " + std::to_string(bytes.size()) +
                " bytes: it holds 2331 at most; the device's name is too long");
  }
  constexpr int kQuiet = 4;
  const double module = side / (code->width + 2 * kQuiet);
  Figure figure{side, side, std::move(description), {}};
  figure.shapes.emplace_back(Area{0, 0, side, side, Ink::kWhite});
  // Neighbours of a row in one area, or hair lines would show between them.
  for (int row = 0; row < code->width; ++row) {
    for (int column = 0; column < code->width; ++column) {
      const auto dark = [&](int at) {
        return at < code->width && (code->data[row * code->width + at] & 1) != 0;
      };
      if (!dark(column)) continue;
      int end = column;
      while (dark(end)) ++end;
      figure.shapes.emplace_back(Area{(kQuiet + column) * module, (kQuiet + row) * module,
                                      (end - column) * module, module, Ink::kBlack});
      column = end;
    }
  }
  return figure;
}

}  // namespace kiroku::report
