#include "sim/volume/nifti_header.h"

#include <cmath>
#include <cstdint>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"
#include "sim/volume/grid.h"

namespace kiroku::sim {
namespace {

constexpr std::int32_t kFirstSize = 348, kSecondSize = 540;

/// Where columns, rows and slices run to.
std::string code_of(const Eigen::Matrix3d& axes_ras) {
  Grid grid;
  grid.direction = axes_ras.colwise().normalized();
  grid.direction.topRows<2>() *= -1;  // to left and back
  return orientation_code(grid);
}

}  // namespace

void refuse_damaged(const std::string& file, const std::string& why) {
  throw Error("cannot read " + file + ": it is damaged or cut off (" + why + ")");
}

GzipFile open_gzip(const std::string& file) {
  GzipFile stream(gzopen(file.c_str(), "rb"));
  if (stream == nullptr) refuse_damaged(file, "it cannot be opened");
  return stream;
}

std::size_t read_gzip(const GzipFile& stream, const std::string& file, char* into, std::size_t wanted) {
  const int got = gzread(stream.get(), into, static_cast<unsigned>(wanted));
  if (got < 0) {
    int error = 0;
    refuse_damaged(file, gzerror(stream.get(), &error));
  }
  return static_cast<std::size_t>(got);
}

NiftiHeader NiftiHeader::read(const GzipFile& stream, const std::string& file) {
  NiftiHeader header;
  const auto extend = [&](std::size_t size) {
    const std::size_t before = header.bytes_.size();
    header.bytes_.resize(size);
    if (read_gzip(stream, file, header.bytes_.data() + before, size - before) < size - before)
      refuse_damaged(file, "its header is not whole");
  };
  extend(kFirstSize);
  const auto size = header.number<std::int32_t>(0);
  header.swapped_ = size != kFirstSize && size != kSecondSize;
  header.first_ = header.number<std::int32_t>(0) != kSecondSize;
  if (!header.first_) extend(kSecondSize);
  return header;
}

double NiftiHeader::real(std::size_t at_of_first, std::size_t at_of_second) const {
  return first_ ? static_cast<double>(number<float>(at_of_first)) : number<double>(at_of_second);
}

Eigen::Vector3d NiftiHeader::size() const {
  Eigen::Vector3d size;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    size[static_cast<Eigen::Index>(axis)] = first_ ? static_cast<double>(number<std::int16_t>(42 + 2 * axis))
                                                   : static_cast<double>(number<std::int64_t>(24 + 8 * axis));
  }
  return size;
}

int NiftiHeader::unit() const {
  constexpr int kOfLength = 7;  // the rest of xyzt_units is of time
  return (first_ ? bytes_[123] : number<std::int32_t>(500)) & kOfLength;
}

NiftiHeader::Placement NiftiHeader::qform() const {
  Placement placement;
  placement.stated = first_ ? number<std::int16_t>(252) > 0 : number<std::int32_t>(344) > 0;  // qform_code
  // As niftilib takes what is out of range (nifti_quatern_to_mat44()).
  Eigen::Vector3d bcd(real(256, 352), real(260, 360), real(264, 368));
  double a = 1 - bcd.squaredNorm();
  if (a < 1e-7) {
    bcd.normalize();
    a = 0;
  }
  const Eigen::Quaterniond turn(std::sqrt(a), bcd.x(), bcd.y(), bcd.z());
  Eigen::Vector3d step;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double stated = real(80 + 4 * axis, 112 + 8 * axis);  // pixdim[1 + axis]
    step[static_cast<Eigen::Index>(axis)] = stated > 0 ? stated : 1;
  }
  if (real(76, 104) < 0) step.z() *= -1;  // pixdim[0], the handedness
  placement.axes = turn.toRotationMatrix() * step.asDiagonal();
  placement.first = {real(268, 376), real(272, 384), real(276, 392)};
  return placement;
}

NiftiHeader::Placement NiftiHeader::sform() const {
  Placement placement;
  placement.stated = first_ ? number<std::int16_t>(254) > 0 : number<std::int32_t>(348) > 0;  // sform_code
  for (std::size_t row = 0; row < 3; ++row) {
    const auto value = [&](std::size_t column) {
      return real(280 + 16 * row + 4 * column, 400 + 32 * row + 8 * column);
    };
    const auto at = static_cast<Eigen::Index>(row);
    placement.axes.row(at) << value(0), value(1), value(2);
    placement.first[at] = value(3);
  }
  return placement;
}

std::string remark_on_placements(const NiftiHeader& header, const std::string& what) {
  const NiftiHeader::Placement q = header.qform(), s = header.sform();
  // What is not sound by itself is refused elsewhere.
  if (!q.stated || !s.stated || !q.axes.allFinite() || !s.axes.allFinite()) return {};
  if (s.axes.colwise().norm().minCoeff() <= 0) return {};
  const Eigen::Vector3d cosines =
      q.axes.colwise().normalized().cwiseProduct(s.axes.colwise().normalized()).colwise().sum().transpose();
  constexpr double kTurned = 0.7;  // by more than 45 degrees
  const bool mirrored = (q.axes.determinant() < 0) != (s.axes.determinant() < 0);
  if (mirrored || cosines.minCoeff() < kTurned) {
    throw Error(what + ": it says twice how it lies in the patient, and " +
                (mirrored ? "one is the mirror image of the other" : "one is turned against the other") +
                ": columns, rows and slices run to " + code_of(q.axes) + " by its qform and to " +
                code_of(s.axes) +
                " by its sform. Find out by an organ of one side which is right, and save it with that one "
                "alone (the code of the other is then 0)");
  }
  const double angle_deg = std::acos(std::min(1.0, cosines.minCoeff())) * 180 / std::numbers::pi;
  const Eigen::Vector3d last = header.size() - Eigen::Vector3d::Ones();
  const double shift =
      std::max((q.first - s.first).norm(), (q.first + q.axes * last - s.first - s.axes * last).norm());
  const double voxel = s.axes.colwise().norm().minCoeff();
  constexpr double kSmallAngleDeg = 1;
  if (!(angle_deg > kSmallAngleDeg) && !(shift > voxel)) return {};
  const auto tenths = [](double value) { return number_text(std::round(value * 10) / 10); };
  return "it says twice how it lies in the patient, and one is taken: its qform and its sform differ by " +
         tenths(angle_deg) + " degrees and up to " + tenths(shift / voxel) + " voxels";
}

}  // namespace kiroku::sim
