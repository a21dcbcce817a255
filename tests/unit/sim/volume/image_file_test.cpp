#include "sim/volume/image_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/volume/image_integrity.h"
#include "sim/volume/volume_reader.h"
#include "tests/support/orientations.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::sim {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

template <typename Value>
std::string raw(const std::vector<Value>& values) {
  std::string bytes(values.size() * sizeof(Value), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

/// A NIfTI file of 16-bit voxels, 4 x 3 x 2, in the words of nifti1.h and nifti2.h.
struct Nifti {
  Eigen::Matrix3d affine = Eigen::Matrix3d::Identity();  // voxel to RAS, mm
  Vector3 offset_mm = {1, 2, 3};
  float slope = 0, intercept = 0;
  std::int16_t sform_code = 1, volumes = 1, type = 4;  // DT_INT16
  char unit = 2;                                       // mm
  std::int16_t qform_code = 0;
  Eigen::Quaternionf qform_turn = Eigen::Quaternionf::Identity();
  float qform_hand = 1;
  Eigen::Vector3f qform_offset_mm = {1, 2, 3};
  std::optional<Eigen::Vector3d> pixdim_mm = {};  // else as the affine has it
  bool second = false, swapped = false;           // NIfTI-2; of the other byte order
  std::string values = raw(std::vector<std::int16_t>{0,  1,  2,  3,  4,  5,  6,  7,  8,  9,  10, 11,
                                                     12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23});

  [[nodiscard]] std::string text() const {
    std::string header(second ? 544 : 352, '\0');
    const auto put = [&]<typename Value>(std::size_t at, Value value) {
      std::memcpy(header.data() + at, &value, sizeof(value));
      if (swapped) std::reverse(header.begin() + long(at), header.begin() + long(at + sizeof(value)));
    };
    // Wider in NIfTI-2, and elsewhere.
    const auto put_whole = [&]<typename First, typename Second>(std::size_t in_first, First,
                                                                std::size_t in_second, Second,
                                                                std::int64_t value) {
      second ? put(in_second, static_cast<Second>(value)) : put(in_first, static_cast<First>(value));
    };
    const auto put_real = [&](std::size_t in_first, std::size_t in_second, double value) {
      second ? put(in_second, value) : put(in_first, static_cast<float>(value));
    };
    constexpr std::int16_t k16 = 0;
    constexpr std::int32_t k32 = 0;
    constexpr std::int64_t k64 = 0;
    put(0, second ? 540 : 348);
    const std::array<std::int64_t, 8> size{volumes > 1 ? 4 : 3, 4, 3, 2, volumes, 1, 1, 1};
    for (std::size_t at = 0; at < 8; ++at) put_whole(40 + 2 * at, k16, 16 + 8 * at, k64, size[at]);
    put_whole(70, k16, 12, k16, type);
    put_whole(72, k16, 14, k16, type == 16 ? 32 : 16);
    put_real(76, 104, qform_hand);
    for (int axis = 0; axis < 3; ++axis)
      put_real(80 + 4 * std::size_t(axis), 112 + 8 * std::size_t(axis),
               pixdim_mm ? (*pixdim_mm)[axis] : affine.col(axis).norm());
    second ? put(168, std::int64_t{544}) : put(108, 352.0F);
    put_real(112, 176, slope);
    put_real(116, 184, intercept);
    second ? put(500, std::int32_t{unit}) : put(123, unit);
    put_whole(252, k16, 344, k32, qform_code);
    put_whole(254, k16, 348, k32, sform_code);
    const std::array<float, 6> qform{qform_turn.x(),      qform_turn.y(),      qform_turn.z(),
                                     qform_offset_mm.x(), qform_offset_mm.y(), qform_offset_mm.z()};
    for (std::size_t at = 0; at < qform.size(); ++at) put_real(256 + 4 * at, 352 + 8 * at, qform[at]);
    for (std::size_t row = 0; row < 3; ++row) {
      const auto at = static_cast<Eigen::Index>(row);
      for (std::size_t column = 0; column < 3; ++column)
        put_real(280 + 16 * row + 4 * column, 400 + 32 * row + 8 * column,
                 affine(at, static_cast<Eigen::Index>(column)));
      put_real(280 + 16 * row + 12, 400 + 32 * row + 24, offset_mm[at]);
    }
    const std::string magic = second ? std::string("n+2\0\r\n\x1A\n", 8) : std::string("n+1\0", 4);
    std::ranges::copy(magic, header.begin() + (second ? 4 : 344));
    std::string voxels = values;
    for (std::size_t at = 0; swapped && at + 1 < voxels.size(); at += 2)
      std::swap(voxels[at], voxels[at + 1]);
    return header + voxels;
  }
};

class ImageFileTest : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  static std::string refusal(const std::filesystem::path& file) {
    try {
      (void)read_image_file(file);
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      return error.what();
    }
    return "";
  }

  test::TemporaryFolder folder_;
};

TEST_F(ImageFileTest, TurnsNiftiFromRasToThePatientInEveryOrientation) {
  const Eigen::DiagonalMatrix<double, 3> to_lps(-1, -1, 1);
  const Eigen::DiagonalMatrix<double, 3> spacing_mm(2, 3, 4);
  for (const Eigen::Matrix3d& direction : test::axis_orientations()) {
    Nifti nifti;
    nifti.affine = direction * spacing_mm;
    const ImageFile image = read_image_file(write("a.nii", nifti.text()));
    EXPECT_EQ(image.format, "NIfTI");
    EXPECT_TRUE(image.placed);
    EXPECT_THAT(image.grid.size, ElementsAre(4U, 3U, 2U));
    for (const Vector3& index : {Vector3(0, 0, 0), Vector3(3, 0, 0), Vector3(1, 2, 1)}) {
      const Vector3 expected_m = to_lps * (nifti.affine * index + nifti.offset_mm) / 1000;
      EXPECT_LT((image.grid.patient_m(index) - expected_m).norm(), 1e-9);
    }
    EXPECT_EQ(image.values[image.grid.offset(1, 2, 1)], 21);
  }
}

TEST_F(ImageFileTest, ReadsObliqueNifti) {
  Nifti nifti;
  nifti.affine = Eigen::AngleAxisd(0.4, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  const Grid grid = read_image_file(write("a.nii", nifti.text())).grid;
  const Vector3 ras_mm = nifti.affine * Vector3(3, 2, 1) + nifti.offset_mm;
  EXPECT_LT((1000 * grid.patient_m({3, 2, 1}) - Vector3(-ras_mm.x(), -ras_mm.y(), ras_mm.z())).norm(), 1e-5);
}

TEST_F(ImageFileTest, AppliesTheSlopeOfNifti) {
  Nifti nifti;
  nifti.slope = 0.5;
  nifti.intercept = -10;
  const ImageFile image = read_image_file(write("a.nii", nifti.text()));
  EXPECT_EQ(image.values[0], -10);
  EXPECT_EQ(image.values[23], 1.5);
}

TEST_F(ImageFileTest, SaysWhereNothingIsKnownOfThePatient) {
  Nifti nifti;
  nifti.sform_code = 0;
  EXPECT_FALSE(read_image_file(write("a.nii", nifti.text())).placed);
  EXPECT_THAT(read_volume(write("a.nii", nifti.text()), {}).findings,
              Contains(HasSubstr("does not say how it lies")));
}

// One was taken, and an organ of the left came to lie on the right.
TEST_F(ImageFileTest, RefusesNiftiThatIsPlacedTwiceAndContradictsItself) {
  Nifti nifti;
  nifti.qform_code = 1;
  const auto findings = [&] { return read_volume(write("a.nii", nifti.text()), {}).findings; };
  const auto is_told = Contains(HasSubstr("says twice how it lies"));
  EXPECT_EQ(refusal(write("a.nii", nifti.text())), "");
  EXPECT_THAT(findings(), testing::Not(is_told));
  nifti.qform_offset_mm = {1, 2, 5.5};
  EXPECT_THAT(findings(), Contains(AllOf(HasSubstr("its sform was taken"),
                                         HasSubstr("differ by 0 degrees and up to 2.5 voxels"))));
  nifti.qform_offset_mm = {1, 2, 3};
  nifti.qform_turn = Eigen::AngleAxisf(0.1F, Eigen::Vector3f::UnitZ());
  EXPECT_THAT(findings(), is_told);
  nifti.qform_turn = Eigen::AngleAxisf(float(M_PI), Eigen::Vector3f::UnitZ());
  EXPECT_THAT(refusal(write("a.nii", nifti.text())),
              AllOf(HasSubstr("one is turned against the other"), HasSubstr("run to LPS by its qform"),
                    HasSubstr("to RAS by its sform")));
  nifti.qform_turn = Eigen::Quaternionf::Identity();
  nifti.qform_hand = -1;
  EXPECT_THAT(refusal(write("a.nii", nifti.text())),
              AllOf(HasSubstr("one is the mirror image of the other"), HasSubstr("run to RAI by its qform"),
                    HasSubstr("by an organ of one side")));
  EXPECT_THAT([&] { (void)read_label_map(write("a.nii", nifti.text())); },
              testing::ThrowsMessage<Error>(HasSubstr("mirror image")));
  nifti.sform_code = 0;
  EXPECT_EQ(refusal(write("a.nii", nifti.text())), "") << "one alone contradicts nothing";
}

// Distances are taken from pixdim, and only where axes run to from the sform.
TEST_F(ImageFileTest, RefusesNiftiWhoseSformHasAnotherScale) {
  Nifti nifti;
  for (const double times : {2.0, 0.5, 1.02}) {
    nifti.pixdim_mm = {times, times, times};
    EXPECT_THAT(refusal(write("a.nii", nifti.text())),
                AllOf(HasSubstr("says twice how far it is from voxel to voxel"),
                      HasSubstr("1 x 1 x 1 mm by its sform")))
        << times;
  }
  nifti.pixdim_mm = {1, 1, 3};
  nifti.qform_code = 1;
  EXPECT_THAT(refusal(write("a.nii", nifti.text())), HasSubstr("1 x 1 x 3 mm by its pixdim"));
  nifti.pixdim_mm = {1.005, 1, 1};
  EXPECT_EQ(refusal(write("a.nii", nifti.text())), "") << "rounding";
  // Not where nothing is placed by it.
  nifti.pixdim_mm = {2, 2, 2};
  nifti.sform_code = 0;
  EXPECT_TRUE(
      read_image_file(write("a.nii", nifti.text())).grid.spacing_m.isApprox(Vector3::Constant(0.002)));
}

TEST_F(ImageFileTest, TellsThatAVolumeWasStretchedToATemplate) {
  Nifti nifti;
  const auto findings = [&] { return read_volume(write("a.nii", nifti.text()), {}).findings; };
  const auto is_told = Contains(HasSubstr("was stretched to a template"));
  for (const auto code : std::initializer_list<std::int16_t>{1, 2}) {
    nifti.sform_code = code;
    EXPECT_THAT(findings(), testing::Not(is_told)) << code;
  }
  nifti.sform_code = 3;
  EXPECT_THAT(findings(), Contains(HasSubstr("its sform is of Talairach")));
  nifti.sform_code = 4;
  EXPECT_THAT(findings(), Contains(HasSubstr("its sform is of MNI 152")));
  nifti.sform_code = 0;
  nifti.qform_code = 4;
  EXPECT_THAT(findings(), Contains(HasSubstr("its qform is of MNI 152")));
}

TEST_F(ImageFileTest, AnSformOfSomethingElseMayBeTurnedAndTheOneThatIsTakenIsNamed) {
  Nifti nifti;
  nifti.qform_code = 1;
  nifti.qform_turn = Eigen::AngleAxisf(float(M_PI) / 2, Eigen::Vector3f::UnitZ());
  const auto findings = [&] { return read_volume(write("a.nii", nifti.text()), {}).findings; };
  for (const auto code : std::initializer_list<std::int16_t>{2, 3, 4}) {
    nifti.sform_code = code;
    const ImageFile image = read_image_file(write("a.nii", nifti.text()));
    const bool of_qform = image.grid.direction.col(0).isApprox(-Vector3::UnitY(), 1e-6);
    EXPECT_TRUE(of_qform != image.grid.direction.col(0).isApprox(-Vector3::UnitX(), 1e-6)) << code;
    EXPECT_THAT(findings(),
                Contains(AllOf(HasSubstr(of_qform ? "its qform was taken" : "its sform was taken"),
                               HasSubstr("differ by 90 degrees"))))
        << code;
    nifti.qform_hand = -1;
    EXPECT_THAT(refusal(write("a.nii", nifti.text())), HasSubstr("mirror image of the other")) << code;
    nifti.qform_hand = 1;
  }
  // The scanner's own one is taken.
  nifti.sform_code = 1;
  nifti.qform_turn = Eigen::AngleAxisf(0.1F, Eigen::Vector3f::UnitZ());
  EXPECT_THAT(findings(), Contains(HasSubstr("its sform was taken")));
}

// An affine transform to a template has lengths of its own, and the patient's own place is taken.
TEST_F(ImageFileTest, TheLengthsOfATemplateAreNotTakenBesideThePatientsOwnPlace) {
  Nifti nifti;
  nifti.qform_code = 1;
  nifti.sform_code = 4;
  nifti.affine *= 1.5;
  nifti.pixdim_mm = {1, 1, 1};
  const ImageFile image = read_image_file(write("a.nii", nifti.text()));
  EXPECT_TRUE(image.grid.spacing_m.isApprox(Vector3::Constant(0.001)));
  EXPECT_THAT(image.findings, ElementsAre(HasSubstr("its qform was taken")));
}

TEST_F(ImageFileTest, ANegativeCodeStatesNoPlace) {
  Nifti nifti;
  nifti.sform_code = -1;
  nifti.qform_code = -1;
  EXPECT_FALSE(read_image_file(write("a.nii", nifti.text())).placed);
  nifti.qform_code = 1;
  EXPECT_TRUE(read_image_file(write("a.nii", nifti.text())).placed);
}

// Not every ITK reads NIfTI-2; what is read of its header here is looked at by itself.
TEST_F(ImageFileTest, ReadsEitherNiftiInEitherByteOrder) {
  for (const bool second : {false, true}) {
    for (const bool swapped : {false, true}) {
      Nifti nifti;
      nifti.second = second;
      nifti.swapped = swapped;
      nifti.affine = Eigen::DiagonalMatrix<double, 3>(2, 3, 4);
      nifti.qform_code = 1;
      const std::filesystem::path file = write("a.nii", nifti.text());
      const GzipFile stream = open_gzip(file.string());
      const NiftiHeader header = NiftiHeader::read(stream, file.string());
      EXPECT_TRUE(header.is_known());
      EXPECT_EQ(header.is_first(), !second);
      EXPECT_EQ(header.is_swapped(), swapped);
      EXPECT_EQ(header.unit(), 2);
      EXPECT_EQ(header.size(), Vector3(4, 3, 2));
      EXPECT_EQ(header.spacing(), Vector3(2, 3, 4));
      for (const NiftiHeader::Placement& place : {header.qform(), header.sform()}) {
        EXPECT_EQ(place.code, 1);
        EXPECT_TRUE(place.axes.isApprox(nifti.affine, 1e-6));
        EXPECT_TRUE(place.first.isApprox(nifti.offset_mm, 1e-6));
      }
      EXPECT_THAT(check_nifti(stream, header, file.string(), 24), testing::IsEmpty());
      EXPECT_THROW(check_nifti(stream, header, file.string(), 25), Error);
      if (const std::string why = refusal(file); second && !why.empty()) {
        EXPECT_THAT(why, HasSubstr("it is of NIfTI-2, which is not read here"));
        continue;
      }
      const ImageFile image = read_image_file(file);
      EXPECT_TRUE(image.placed);
      EXPECT_THAT(image.findings, testing::IsEmpty());
      EXPECT_THAT(image.grid.size, ElementsAre(4U, 3U, 2U));
      EXPECT_TRUE((1000 * image.grid.patient_m({1, 1, 1})).isApprox(Vector3(-3, -5, 7), 1e-6));
      EXPECT_EQ(image.values[image.grid.offset(1, 2, 1)], 21);
      EXPECT_THAT(refusal(write("cut.nii", nifti.text().substr(0, nifti.text().size() - 1))),
                  HasSubstr("it holds 23 of 24 voxels"));
      nifti.qform_hand = -1;
      EXPECT_THAT(refusal(write("a.nii", nifti.text())), HasSubstr("mirror image"));
      nifti.qform_hand = 1;
      nifti.pixdim_mm = {2, 3, 8};
      EXPECT_THAT(refusal(write("a.nii", nifti.text())), HasSubstr("2 x 3 x 8 mm by its pixdim"));
    }
  }
}

const std::string kNrrd =
    "NRRD0004\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 4 3 2\n"
    "space directions: (0,2,0) (3,0,0) (0,0,-4)\nspace origin: (1,2,3)\nencoding: raw\nendian: little\n\n";
const std::string kMetaImage =
    "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
    "TransformMatrix = 0 1 0 1 0 0 0 0 -1\nOffset = 1 2 3\nElementSpacing = 2 3 4\nDimSize = 4 3 2\n"
    "ElementType = MET_SHORT\nElementDataFile = LOCAL\n";

TEST_F(ImageFileTest, ReadsNrrdAndMetaImage) {
  for (const auto& [name, header] : {std::pair{"a.nrrd", kNrrd}, {"a.mha", kMetaImage}}) {
    const ImageFile image = read_image_file(write(name, header + Nifti().values));
    EXPECT_THAT(image.grid.size, ElementsAre(4U, 3U, 2U));
    EXPECT_LT((image.grid.patient_m({1, 0, 0}) - Vector3(0.001, 0.004, 0.003)).norm(), 1e-12) << name;
    EXPECT_LT((image.grid.patient_m({0, 1, 1}) - Vector3(0.004, 0.002, -0.001)).norm(), 1e-12) << name;
    EXPECT_EQ(image.values[image.grid.offset(1, 2, 1)], 21);
  }
  std::string ras = kNrrd;
  ras.replace(ras.find("left-posterior"), 14, "right-anterior");
  EXPECT_LT((read_image_file(write("a.nrrd", ras + Nifti().values)).grid.patient_m({1, 0, 0}) -
             Vector3(-0.001, -0.004, 0.003))
                .norm(),
            1e-12);
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  text.replace(text.find(what), what.size(), by);
  return text;
}

TEST_F(ImageFileTest, TakesUnitsOfLengthAsTheyAreStated) {
  const auto of = [&](const std::string& name, const std::string& header) {
    return read_image_file(write(name, header + Nifti().values)).grid;
  };
  const auto nrrd_in = [&](const std::string& units) {
    return replaced(kNrrd, "encoding", "space units: " + units + "\nencoding");
  };
  const auto meta_in = [&](const std::string& unit) {
    return replaced(kMetaImage, "DimSize", "DistanceUnits = " + unit + "\nDimSize");
  };
  const Grid grid = of("a.nrrd", kNrrd);
  for (const auto& [unit, times] :
       {std::pair{"mm", 1.0}, {"cm", 10.0}, {"m", 1000.0}, {"um", 1e-3}, {"???", 1.0}, {"", 1.0}}) {
    const std::string each = "\"" + std::string(unit) + "\"";
    const Grid scaled = of("a.nrrd", nrrd_in(each + " " + each + " " + each));
    EXPECT_TRUE(scaled.spacing_m.isApprox(times * grid.spacing_m)) << unit;
    EXPECT_TRUE(scaled.origin_m.isApprox(times * grid.origin_m)) << unit;
  }
  EXPECT_TRUE(of("a.mha", meta_in("cm")).spacing_m.isApprox(10 * of("a.mha", kMetaImage).spacing_m));
  // ITK takes the distances of such a file, and the first voxel a thousand times nearer.
  for (const auto& [unit, times] : {std::pair{char{1}, 0.001}, {char{3}, 1000.0}}) {
    Nifti nifti;
    nifti.unit = unit;
    nifti.affine *= times;
    nifti.qform_offset_mm *= float(times);
    nifti.qform_code = 1;
    nifti.sform_code = 0;
    EXPECT_THAT(refusal(write("a.nii", nifti.text())), HasSubstr("not the millimetre; save it in mm"));
  }
  EXPECT_THAT(refusal(write("a.nrrd", nrrd_in("\"in\" \"in\" \"in\"") + Nifti().values)),
              HasSubstr("its unit of length is 'in', which is not known; save it in mm"));
  EXPECT_THAT(refusal(write("a.nrrd", nrrd_in("\"mm\" \"mm\" \"cm\"") + Nifti().values)),
              HasSubstr("units that differ"));
  const std::string bare =
      "NRRD0004\ntype: short\ndimension: 3\nsizes: 4 3 2\nspacings: 2 3 4\nunits: \"cm\" \"cm\" "
      "\"cm\"\nencoding: raw\nendian: little\n\n";
  EXPECT_TRUE(of("a.nrrd", bare).spacing_m.isApprox(Vector3(0.02, 0.03, 0.04)));
}

TEST_F(ImageFileTest, SaysWhereASpaceIsNotThePatients) {
  const auto in = [&](const std::string& space) {
    return write("a.nrrd", replaced(kNrrd, "left-posterior-superior", space) + Nifti().values);
  };
  for (const char* const of_patient : {"left-posterior-superior", "LAS", "right-anterior-superior"})
    EXPECT_TRUE(read_image_file(in(of_patient)).placed) << of_patient;
  for (const char* const other : {"scanner-xyz", "3D-right-handed"})
    EXPECT_FALSE(read_image_file(in(other)).placed) << other;
  EXPECT_THAT(refusal(in("3D-left-handed")), HasSubstr("its mirror image"));
}

TEST_F(ImageFileTest, AMetaImageSaysHowItLiesOrThatIsTold) {
  const auto image = [&](const std::string& matrix, const std::string& orientation) {
    std::string header = replaced(kMetaImage, "TransformMatrix = 0 1 0 1 0 0 0 0 -1\n", matrix);
    if (!orientation.empty())
      header = replaced(header, "DimSize", "AnatomicalOrientation = " + orientation + "\nDimSize");
    return write("a.mha", header + Nifti().values);
  };
  const std::string identity = "TransformMatrix = 1 0 0 0 1 0 0 0 1\n";
  const std::string mirrored = "TransformMatrix = -1 0 0 0 1 0 0 0 1\n";
  EXPECT_TRUE(read_image_file(image(identity, "")).placed);
  EXPECT_TRUE(read_image_file(image(identity, "RAI")).placed) << "as ITK writes it";
  EXPECT_TRUE(read_image_file(image(identity, "LPS")).placed) << "as others do";
  EXPECT_TRUE(read_image_file(image(mirrored, "LAI")).placed);
  EXPECT_TRUE(read_image_file(image("", "RAI")).placed);
  for (const char* const unsaid : {"", "???"}) {
    EXPECT_FALSE(read_image_file(image("", unsaid)).placed);
    EXPECT_THAT(read_volume(image("", unsaid), {}).findings, Contains(HasSubstr("does not say how it lies")));
  }
  EXPECT_THAT(refusal(image(identity, "RAS")),
              HasSubstr("AnatomicalOrientation = RAS, which contradicts its TransformMatrix"));
  EXPECT_THAT(refusal(image(mirrored, "RAI")), HasSubstr("contradicts its TransformMatrix"));
  for (const char* const unclear : {"RAS", "LAI", "LPS"})
    EXPECT_THAT(refusal(image("", unclear)), HasSubstr("has no TransformMatrix")) << unclear;
}

/// A header with the line that says where its voxels are.
std::string detached(const std::string& header, const std::string& where) {
  const std::string local = "ElementDataFile = LOCAL\n";
  return header.ends_with(local) ? header.substr(0, header.size() - local.size()) + where
                                 : header.substr(0, header.size() - 1) + where + "\n";
}

TEST_F(ImageFileTest, TellsWhichFileHoldsTheVoxels) {
  for (const auto& [name, header] : {std::pair{"a.nrrd", kNrrd}, {"a.mha", kMetaImage}})
    EXPECT_EQ(data_file_of(write(name, header + Nifti().values)), std::nullopt) << name;
  EXPECT_EQ(data_file_of(write("a.nii", Nifti().text())), std::nullopt);
  EXPECT_EQ(data_file_of(write("trace.csv", "0, 1")), std::nullopt);

  std::filesystem::create_directory(folder_ / "of");
  for (const char* const voxels : {"b.raw", "of/b.raw"}) {
    write(voxels, Nifti().values);
    for (const auto& [name, text] :
         {std::pair{"b.mhd", detached(kMetaImage, std::string("ElementDataFile = ") + voxels + "\n")},
          {"b.mha", detached(kMetaImage, std::string("ElementDataFile = ") + voxels + "\n")},
          {"b.nhdr", detached(kNrrd, std::string("data file: ") + voxels + "\n")},
          {"b.nrrd", detached(kNrrd, std::string("datafile: ./") + voxels + "\n")}}) {
      const auto header = write(name, text);
      const auto data = data_file_of(header);
      ASSERT_TRUE(data) << name;
      EXPECT_EQ((header.parent_path() / *data).lexically_normal(), folder_ / voxels) << name;
      // The reader takes that file, and no other one.
      std::string changed = Nifti().values;
      changed[0] = 77;
      write(voxels, changed);
      EXPECT_EQ(read_image_file(header).values[0], 77) << name;
      write(voxels, Nifti().values);
    }
  }
}

TEST_F(ImageFileTest, NamesNoFileWhereSeveralHoldTheVoxels) {
  const std::string slice = Nifti().values.substr(0, 24);
  for (const char* const name : {"s1.raw", "s2.raw"}) write(name, slice);
  for (const auto& [name, text] :
       {std::pair{"c.mhd", detached(kMetaImage, "ElementDataFile = LIST\ns1.raw\ns2.raw\n")},
        {"d.mhd", detached(kMetaImage, "ElementDataFile = s%d.raw 1 2 1\n")},
        {"c.nhdr", detached(kNrrd, "data file: LIST\ns1.raw\ns2.raw")},
        {"d.nhdr", detached(kNrrd, "data file: s%d.raw 1 2 1\n")},
        {"e.mhd", detached(kMetaImage, "ElementDataFile = " + (folder_ / "s1.raw").string() + "\n")},
        {"e.nhdr", detached(kNrrd, "data file: " + (folder_ / "s1.raw").string() + "\n")}}) {
    const auto header = write(name, text);
    EXPECT_THAT([&] { (void)data_file_of(header); },
                testing::ThrowsMessage<Error>(HasSubstr("save the volume as one .mha or .nrrd file")))
        << name;
  }
}

// niftilib would take the header of one file and the voxels of the other.
TEST_F(ImageFileTest, TakesNoVoxelsFromAFileBesideACompressedOne) {
  const auto compressed = write("f.nii.gz", Nifti().text());  // zlib reads what is not compressed as it is
  EXPECT_EQ(read_image_file(compressed).values[1], 1);
  write("f.nii", Nifti().text());
  EXPECT_THAT(refusal(compressed), HasSubstr("f.nii lies beside it"));
}

TEST_F(ImageFileTest, RefusesInOneSentenceWithTheName) {
  const std::string nifti = Nifti().text();
  for (const std::size_t kept :
       {std::size_t{0}, std::size_t{100}, std::size_t{351}, std::size_t{360}, nifti.size() - 1}) {
    EXPECT_THAT(refusal(write("cut.nii", nifti.substr(0, kept))), HasSubstr("cut.nii")) << kept;
  }
  EXPECT_THAT(refusal(write("cut.nrrd", kNrrd + Nifti().values.substr(1))), HasSubstr("cut.nrrd"));
  EXPECT_THAT(refusal(write("cut.mha", kMetaImage + Nifti().values.substr(1))), HasSubstr("cut.mha"));
  EXPECT_THAT(refusal(write("a.mha", "no image")), HasSubstr("a.mha"));
  EXPECT_THAT(refusal(write("a.png", "")), HasSubstr("must be .nii"));
  Nifti series;
  series.volumes = 2;
  series.values += series.values;
  EXPECT_THAT(refusal(write("a.nii", series.text())), HasSubstr("2 volumes"));
  std::string huge = kNrrd;
  huge.replace(huge.find("4 3 2"), 5, "99999 99999 99999");
  EXPECT_THAT(refusal(write("a.nrrd", huge)), HasSubstr("more than are handled"));
  std::string sheared = kNrrd;
  sheared.replace(sheared.find("(3,0,0)"), 7, "(3,1,0)");
  EXPECT_THAT(refusal(write("a.nrrd", sheared + Nifti().values)), HasSubstr("right angles"));
}

TEST_F(ImageFileTest, TakesWhatIsNoNumberForPadding) {
  Nifti nifti;
  nifti.type = 16;  // DT_FLOAT32
  std::vector<float> values(24, -30);
  values[0] = std::numeric_limits<float>::quiet_NaN();
  values[1] = -std::numeric_limits<float>::infinity();
  values[2] = -2048;
  nifti.values = raw(values);
  const VolumeFile file = read_volume(write("a.nii", nifti.text()), {});
  EXPECT_EQ(file.padding_voxels, 3U);
  EXPECT_THAT(std::vector<float>(file.volume.hu.begin(), file.volume.hu.begin() + 4),
              ElementsAre(-1000, -1000, -1000, -30));
}

TEST_F(ImageFileTest, ReadsLabelsAndRefusesOtherNumbers) {
  EXPECT_EQ(read_label_map(write("a.nii", Nifti().text())).labels[23], 23);
  std::vector<std::string> findings;
  (void)read_label_map(write("a.nii", Nifti().text()), &findings);
  EXPECT_THAT(findings, testing::IsEmpty());
  Nifti nowhere;
  nowhere.sform_code = 0;
  (void)read_label_map(write("organs.nii", nowhere.text()), &findings);
  EXPECT_THAT(findings, ElementsAre(HasSubstr("labels organs.nii: the file does not say how it lies")));
  Nifti half;
  half.slope = 0.5;
  EXPECT_THROW((void)read_label_map(write("a.nii", half.text())), Error);
  Nifti negative;
  negative.intercept = -1;
  negative.slope = 1;
  EXPECT_THROW((void)read_label_map(write("a.nii", negative.text())), Error);
}

TEST_F(ImageFileTest, FindsWhatIsNoCtOfAPatient) {
  Nifti nifti;
  nifti.affine *= 1000;
  EXPECT_THAT(read_volume(write("a.nii", nifti.text()), {}).findings,
              AllOf(Contains(HasSubstr("least value is 0")), Contains(HasSubstr("4 m long"))));
  EXPECT_THROW((void)read_volume(write("a.nii", nifti.text()), {"1", false}), UsageError);
}

}  // namespace
}  // namespace kiroku::sim
