#include "sim/volume/nifti_header.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "base/error.h"
#include "base/number_text.h"

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

using Placement = NiftiHeader::Placement;

constexpr int kAligned = 2, kTalairach = 3, kMni = 4;  // NIFTI_XFORM_...; 1 is the scanner

bool is_of_template(const Placement& place) { return place.code == kTalairach || place.code == kMni; }

/// How far what was read lies from what a place says.
double distance(const Placement& place, const Grid& read) {
  const Eigen::DiagonalMatrix<double, 3> to_lps(-1, -1, 1);
  const double off_mm = (to_lps * place.first - 1000 * read.origin_m).norm();
  return (to_lps * place.axes.colwise().normalized() - read.direction).norm() +
         off_mm / (1000 * read.spacing_m.norm());
}

/// By the largest part of its length by which a step of the sform differs from what lies between two voxels.
double stretch_of(const Placement& sform, const NiftiHeader& header) {
  const Eigen::Vector3d spacing = header.spacing();
  return ((sform.axes.colwise().norm().transpose() - spacing).array().abs() / spacing.array()).maxCoeff();
}

// What is not sound by itself is refused elsewhere.
bool is_sound(const Placement& place) {
  return place.stated() && place.axes.allFinite() && place.axes.colwise().norm().minCoeff() > 0;
}

/// How far it is between voxels is taken from pixdim, whichever place is taken.
void require_one_scale(const NiftiHeader& header, const Placement& sform, const std::string& what) {
  constexpr double kRounding = 0.01;
  if (stretch_of(sform, header) < kRounding) return;
  const auto lengths = [](const Eigen::Vector3d& of) {
    return number_text(of.x()) + " x " + number_text(of.y()) + " x " + number_text(of.z());
  };
  throw Error(what + ": it says twice how far it is from voxel to voxel: " + lengths(header.spacing()) +
              " mm by its pixdim and " + lengths(sform.axes.colwise().norm().transpose()) +
              " mm by its sform. Find out by something whose length is known which is right, and save it "
              "anew with that one");
}

std::string tenths(double value) { return number_text(std::round(value * 10) / 10); }

/// Of a file that says both.
std::string remark_on_both(const NiftiHeader& header, const Placement& q, const Placement& s,
                           bool takes_sform, const std::string& what) {
  const Eigen::Vector3d cosines =
      q.axes.colwise().normalized().cwiseProduct(s.axes.colwise().normalized()).colwise().sum().transpose();
  constexpr double kTurned = 0.7;  // by more than 45 degrees
  const bool mirrored = (q.axes.determinant() < 0) != (s.axes.determinant() < 0);
  // What the sform aligns to something else may be turned.
  if (mirrored || (cosines.minCoeff() < kTurned && s.code < kAligned)) {
    throw Error(what + ": it says twice how it lies in the patient, and " +
                (mirrored ? "one is the mirror image of the other" : "one is turned against the other") +
                ": columns, rows and slices run to " + code_of(q.axes) + " by its qform and to " +
                code_of(s.axes) +
                " by its sform. Find out by an organ of one side which is right, and save it with that one "
                "alone (the code of the other is then 0)");
  }
  const double angle_deg = std::acos(std::clamp(cosines.minCoeff(), -1.0, 1.0)) * 180 / std::numbers::pi;
  const Eigen::Vector3d last = header.size() - Eigen::Vector3d::Ones();
  const double shift =
      std::max((q.first - s.first).norm(), (q.first + q.axes * last - s.first - s.axes * last).norm());
  const double voxel = header.spacing().minCoeff();
  constexpr double kSmallAngleDeg = 1;
  if (!(angle_deg > kSmallAngleDeg) && !(shift > voxel)) return {};
  return std::string("it says twice how it lies in the patient, and its ") +
         (takes_sform ? "sform" : "qform") + " was taken: its qform and its sform differ by " +
         tenths(angle_deg) + " degrees and up to " + tenths(shift / voxel) + " voxels";
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

bool NiftiHeader::is_known() const { return number<std::int32_t>(0) == (first_ ? kFirstSize : kSecondSize); }

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

Eigen::Vector3d NiftiHeader::spacing() const {
  Eigen::Vector3d spacing;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double stated = real(80 + 4 * axis, 112 + 8 * axis);  // pixdim[1 + axis]
    spacing[static_cast<Eigen::Index>(axis)] = stated > 0 ? stated : 1;
  }
  return spacing;
}

int NiftiHeader::unit() const {
  constexpr int kOfLength = 7;  // the rest of xyzt_units is of time
  return (first_ ? bytes_[123] : number<std::int32_t>(500)) & kOfLength;
}

NiftiHeader::Placement NiftiHeader::qform() const {
  Placement placement;
  placement.code = first_ ? number<std::int16_t>(252) : number<std::int32_t>(344);  // qform_code
  // As niftilib takes what is out of range (nifti_quatern_to_mat44()).
  Eigen::Vector3d bcd(real(256, 352), real(260, 360), real(264, 368));
  double a = 1 - bcd.squaredNorm();
  if (a < 1e-7) {
    bcd.normalize();
    a = 0;
  }
  const Eigen::Quaterniond turn(std::sqrt(a), bcd.x(), bcd.y(), bcd.z());
  Eigen::Vector3d step = spacing();
  if (real(76, 104) < 0) step.z() *= -1;  // pixdim[0], the handedness
  placement.axes = turn.toRotationMatrix() * step.asDiagonal();
  placement.first = {real(268, 376), real(272, 384), real(276, 392)};
  return placement;
}

NiftiHeader::Placement NiftiHeader::sform() const {
  Placement placement;
  placement.code = first_ ? number<std::int16_t>(254) : number<std::int32_t>(348);  // sform_code
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

void explain_refusal(const NiftiHeader& header, const std::string& what) {
  if (!header.is_known()) return;
  if (!header.is_first())
    throw Error(what + ": it is of NIfTI-2, which is not read here; save it as NIfTI-1");
  const Placement q = header.qform(), s = header.sform();
  if (is_sound(s) && (!is_sound(q) || !is_of_template(s))) require_one_scale(header, s, what);
}

std::vector<std::string> remarks_on_places(const NiftiHeader& header, const Grid& read,
                                           const std::string& what) {
  const Placement q = header.qform(), s = header.sform();
  const bool has_q = is_sound(q), has_s = is_sound(s);
  if (!has_q && !has_s) return {};
  const bool takes_sform = has_s && (!has_q || distance(s, read) < distance(q, read));
  std::vector<std::string> remarks;
  // What stretches the patient to a template tells nothing of lengths, beside a place that is the patient's
  // own.
  if (has_s && (takes_sform || !is_of_template(s))) require_one_scale(header, s, what);
  if (has_q && has_s) {
    std::string remark = remark_on_both(header, q, s, takes_sform, what);
    if (!remark.empty()) remarks.push_back(std::move(remark));
  }
  const Placement& taken = takes_sform ? s : q;
  if (is_of_template(taken)) {
    remarks.push_back(std::string("the volume was stretched to a template (its ") +
                      (takes_sform ? "sform" : "qform") + " is of " +
                      (taken.code == kMni ? "MNI 152" : "Talairach") +
                      "): lengths and places in it are not the patient's own");
  }
  return remarks;
}

}  // namespace kiroku::sim
