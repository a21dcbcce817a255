#include "sim/volume/dicom_series.h"

#include <fstream>
#include <numbers>
#include <zlib.h>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "sim/volume/volume_reader.h"
#include "tests/support/dicom_writer.h"
#include "tests/support/orientations.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::sim {
namespace {

using test::DicomCompression;
using test::DicomSlice;
using test::write_dicom;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

/// A whole number of HU for a place, so that each voxel shows where it came from.
double field(const Vector3& at_mm) { return 5 + 2 * at_mm.x() - 3 * at_mm.y() + 7 * at_mm.z(); }

class DicomSeriesTest : public testing::Test {
 protected:
  [[nodiscard]] std::filesystem::path folder() const { return folder_.path(); }

  /// A slice at this place, its pixels those of field().
  [[nodiscard]] DicomSlice slice_at(const Vector3& position_mm, const Eigen::Matrix3d& direction,
                                    int number) const {
    DicomSlice slice;
    slice.rows = rows_;
    slice.columns = columns_;
    slice.position_mm = position_mm;
    slice.along_row = direction.col(0);
    slice.down_column = direction.col(1);
    slice.column_spacing_mm = 2;
    slice.row_spacing_mm = 1;
    slice.instance_uid = "1.2.3.4." + std::to_string(number);
    for (int row = 0; row < slice.rows; ++row) {
      for (int column = 0; column < slice.columns; ++column) {
        const Vector3 at_mm = position_mm + 2.0 * column * slice.along_row + 1.0 * row * slice.down_column;
        slice.stored.push_back(
            static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(field(at_mm) + 1024))));
      }
    }
    return slice;
  }

  /// Slices at these heights along the normal, and shifted by `shift` of them down the columns; files are
  /// named against their order.
  void write_stack(const std::vector<double>& heights_mm,
                   const Eigen::Matrix3d& direction = Eigen::Matrix3d::Identity(), double shift = 0,
                   const std::function<void(DicomSlice&)>& change = {}) const {
    const Vector3 normal = direction.col(0).cross(direction.col(1));
    for (std::size_t at = 0; at < heights_mm.size(); ++at) {
      DicomSlice slice = slice_at(Vector3(10, -20, 30) + heights_mm[at] * (normal + shift * direction.col(1)),
                                  direction, static_cast<int>(at));
      if (change) change(slice);
      write_dicom(folder() / ("slice" + std::to_string(90 - at) + ".dcm"), slice);
    }
  }

  [[nodiscard]] DicomVolume read(bool resample = false, const std::string& series = "") const {
    return read_dicom_series(choose_series(find_dicom_series(folder()), series), resample);
  }

  [[nodiscard]] std::string refusal(bool resample = false, const std::string& series = "") const {
    try {
      (void)read(resample, series);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  static void expect_field(const Volume& volume, double tolerance) {
    for (std::size_t k = 0; k < volume.grid.size[2]; ++k) {
      for (std::size_t j = 0; j < volume.grid.size[1]; ++j) {
        for (std::size_t i = 0; i < volume.grid.size[0]; ++i) {
          const float hu = volume.hu[volume.grid.offset(i, j, k)];
          if (hu == kAirHu) continue;
          const Vector3 at_m = volume.grid.patient_m({double(i), double(j), double(k)});
          ASSERT_NEAR(double(hu), field(1000 * at_m), tolerance) << i << " " << j << " " << k;
        }
      }
    }
  }

  std::uint16_t rows_ = 3, columns_ = 4;  // of every slice

 private:
  test::TemporaryFolder folder_;
};

TEST_F(DicomSeriesTest, PutsEveryVoxelWhereItIsInThePatientInEveryOrientation) {
  for (const Eigen::Matrix3d& direction : test::axis_orientations()) {
    write_stack({0, 2.5, 5, 7.5, 10}, direction);
    const DicomVolume read_back = read();
    EXPECT_THAT(read_back.volume.grid.size, ElementsAre(4U, 3U, 5U));
    EXPECT_TRUE(read_back.volume.grid.spacing_m.isApprox(Vector3(0.002, 0.001, 0.0025)));
    EXPECT_EQ(read_back.volume.grid.direction.col(0), direction.col(0));
    EXPECT_EQ(read_back.volume.grid.direction.col(1), direction.col(1));
    EXPECT_THAT(read_back.instance_uids,
                ElementsAre("1.2.3.4.0", "1.2.3.4.1", "1.2.3.4.2", "1.2.3.4.3", "1.2.3.4.4"));
    EXPECT_EQ(read_back.padding_voxels, 0U);
    expect_field(read_back.volume, 0.501);
  }
}

TEST_F(DicomSeriesTest, ReadsObliqueSlices) {
  write_stack({0, 2, 4}, Eigen::AngleAxisd(0.4, Vector3(1, 2, 3).normalized()).toRotationMatrix());
  expect_field(read().volume, 0.51);
}

TEST_F(DicomSeriesTest, AppliesSlopeInterceptAndSigns) {
  const auto values = [&](const std::function<void(DicomSlice&)>& change) {
    write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, [&](DicomSlice& slice) {
      slice.stored = {0, 1, 2, 100, 4095, 4096, 32767, 32768, 65535, 63536, 40000, 50000};
      change(slice);
    });
    const std::vector<float> hu = read().volume.hu;
    return std::vector<float>(hu.begin(), hu.begin() + 12);
  };
  EXPECT_THAT(values([](DicomSlice& slice) { slice.intercept = 0; }),
              ElementsAre(0, 1, 2, 100, 4095, 4096, 32767, kAirHu, -1, kAirHu, kAirHu, kAirHu));
  EXPECT_THAT(values([](DicomSlice& slice) {
                slice.is_signed = false;
                slice.slope = 0.5;
                slice.intercept = -100;
              }),
              ElementsAre(-100, -99.5, -99, -50, 1947.5, 1948, 16283.5, 16284, 32667.5, 31668, 19900, 24900));
  // Twelve bits: what stands above them is no part of the number.
  EXPECT_THAT(values([](DicomSlice& slice) {
                slice.intercept = 0;
                slice.bits_stored = 12;
              }),
              ElementsAre(0, 1, 2, 100, -1, 0, -1, 0, -1, kAirHu, 3136 - 4096, 848));
}

TEST_F(DicomSeriesTest, CountsPaddingAndMakesItAir) {
  const auto padded = [](DicomSlice& slice) {
    slice.intercept = -1024;
    slice.stored = {63536, 1024, 1024, 1025, 1026, 1030, 2000, 2000, 2000, 2000, 2000, 2000};
  };
  write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, padded);
  DicomVolume read_back = read();
  EXPECT_EQ(read_back.padding_voxels, 2U);  // -2000 - 1024, said by no tag
  EXPECT_EQ(read_back.volume.hu[0], kAirHu);
  EXPECT_EQ(read_back.volume.hu[1], 0);
  write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, [&](DicomSlice& slice) {
    padded(slice);
    slice.elements = {{"(0028,0120)", "1024"}, {"(0028,0121)", "1026"}};  // a padding range
  });
  read_back = read();
  EXPECT_EQ(read_back.padding_voxels, 10U);
  EXPECT_EQ(read_back.volume.hu[4], kAirHu);
  EXPECT_EQ(read_back.volume.hu[5], 6);
}

TEST_F(DicomSeriesTest, ReadsWhatScannersCompress) {
  rows_ = columns_ = 24;
  for (const DicomCompression compression :
       {DicomCompression::kRunLength, DicomCompression::kJpegLossless, DicomCompression::kJpegLs}) {
    write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, [&](DicomSlice& slice) {
      slice.compression = compression;
      slice.is_signed = false;  // JPEG-LS of DCMTK knows no signs
    });
    const Volume volume = read().volume;
    EXPECT_EQ(volume.hu[0], static_cast<float>(field({10, -20, 30})));
    expect_field(volume, 0.501);
  }
}

TEST_F(DicomSeriesTest, RefusesATiltedGantryWithTheAngleOrResamples) {
  const double shift = std::tan(18.5 * std::numbers::pi / 180);
  write_stack({0, 2, 4, 6}, Eigen::Matrix3d::Identity(), shift,
              [](DicomSlice& slice) { slice.elements["(0018,1120)"] = "18.5"; });
  EXPECT_THAT(refusal(), AllOf(HasSubstr("tilted by 18.5 degrees"), HasSubstr("(the header says 18.5)")));
  const DicomVolume resampled = read(true);
  EXPECT_THAT(resampled.resampled, HasSubstr("18.5 degrees"));
  EXPECT_THAT(resampled.instance_uids, testing::IsEmpty());
  EXPECT_THAT(resampled.volume.grid.size, ElementsAre(4U, 6U, 4U));
  expect_field(resampled.volume, 0.51);
  // Each slice gives the rows that lie within it: three of the first, two of the others, whose rows are
  // between.
  EXPECT_EQ(std::ranges::count(resampled.volume.hu, kAirHu), 96 - 4 * (3 + 2 + 2 + 2));
}

TEST_F(DicomSeriesTest, RefusesUnevenGapsWithTheNumbersOrResamples) {
  write_stack({0, 2, 4, 8, 10});
  EXPECT_THAT(refusal(), HasSubstr("its slices lie 2 to 4 mm apart (median 2)"));
  const DicomVolume resampled = read(true);
  EXPECT_THAT(resampled.volume.grid.size, ElementsAre(4U, 3U, 6U));
  EXPECT_EQ(std::ranges::count(resampled.volume.hu, kAirHu), 0);
  expect_field(resampled.volume, 0.51);
}

TEST_F(DicomSeriesTest, BearsWhatIsRounded) {
  write_stack({0, 2.04, 3.97, 6});
  EXPECT_EQ(refusal(), "");
}

TEST_F(DicomSeriesTest, NamesMissingTags) {
  const auto without = [&](const std::string& tag) {
    write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, [&](DicomSlice& slice) { slice.elements[tag] = ""; });
    return refusal();
  };
  EXPECT_THAT(without("(0020,0032)"), HasSubstr("slice89.dcm lacks ImagePositionPatient (0020,0032)"));
  EXPECT_THAT(without("(0020,0037)"), HasSubstr("lacks ImageOrientationPatient (0020,0037)"));
  EXPECT_THAT(without("(0028,0030)"), HasSubstr("lacks PixelSpacing (0028,0030)"));
  EXPECT_THAT(without("(0028,1052)"), HasSubstr("lacks RescaleIntercept (0028,1052)"));
  EXPECT_THAT(without("(0028,1053)"), HasSubstr("lacks RescaleSlope (0028,1053)"));
  EXPECT_THAT(without("(0028,0010)"), HasSubstr("lacks Rows (0028,0010)"));
  EXPECT_THAT(without("(0028,0103)"), HasSubstr("lacks PixelRepresentation (0028,0103)"));
  EXPECT_EQ(without("(0028,0102)"), "");  // HighBit follows from BitsStored
  EXPECT_EQ(without("(0020,000e)"), "");
}

TEST_F(DicomSeriesTest, RefusesWhatIsNoStackOfSlices) {
  const auto with = [&](const std::string& tag, const std::string& value) {
    write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0,
                [&](DicomSlice& slice) { slice.elements[tag] = value; });
    return refusal();
  };
  EXPECT_THAT(with("(0028,0030)", "0\\1"), HasSubstr("PixelSpacing that is not positive"));
  EXPECT_THAT(with("(0020,0037)", "1\\0\\0\\1\\0\\0"), HasSubstr("right angles"));
  EXPECT_THAT(with("(0028,1053)", "0"), HasSubstr("RescaleSlope of 0"));
  EXPECT_THAT(with("(0028,0008)", "2"), HasSubstr("holds 2 pictures in one file (multi-frame)"));
  EXPECT_THAT(with("(0028,0002)", "3"), HasSubstr("colour"));
  EXPECT_THAT(with("(0028,0010)", "300"),
              HasSubstr(".dcm: its pixels are cut off: 24 bytes instead of 2400"));
  write_stack({0, 0, 2});
  EXPECT_THAT(refusal(), HasSubstr("slice89.dcm and slice90.dcm are at the same place"));
}

TEST_F(DicomSeriesTest, RefusesPicturesThatDiffer) {
  const auto with = [&](const std::function<void(DicomSlice&)>& change) {
    int number = 0;
    write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, [&](DicomSlice& slice) {
      if (++number == 2) change(slice);
    });
    return refusal();
  };
  EXPECT_THAT(with([](DicomSlice& slice) { std::swap(slice.rows, slice.columns); }),
              HasSubstr("slice90.dcm and slice89.dcm differ in the number of pixels"));
  EXPECT_THAT(with([](DicomSlice& slice) { slice.row_spacing_mm = 1.1; }),
              HasSubstr("differ in the size of pixels"));
  EXPECT_THAT(with([](DicomSlice& slice) {
                slice.along_row = {-1, 0, 0};
              }),
              HasSubstr("direction in the patient"));
}

TEST_F(DicomSeriesTest, RefusesWhatIsNotMeasuredInHounsfieldUnits) {
  const auto with = [&](const std::string& tag, const std::string& value) {
    write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0,
                [&](DicomSlice& slice) { slice.elements[tag] = value; });
    return refusal();
  };
  EXPECT_THAT(with("(0008,0060)", "PT"), HasSubstr("is no CT (Modality PT)"));
  EXPECT_THAT(with("(0008,0060)", "MR"), HasSubstr("its numbers are no Hounsfield units"));
  EXPECT_THAT(with("(0028,1054)", "Z_EFF"), HasSubstr("holds no Hounsfield units (RescaleType Z_EFF)"));
  EXPECT_THAT(with("(0028,1054)", "EDW"), HasSubstr("RescaleType EDW"));
  EXPECT_EQ(with("(0028,1054)", "HU"), "");
  EXPECT_EQ(with("(0008,0060)", ""), "");
  EXPECT_EQ(with("(0028,1054)", "US"), "");
  EXPECT_THAT(read().findings, ElementsAre(HasSubstr("RescaleType is US")));
}

// As of a breath held and let go: every second slice is of another body.
TEST_F(DicomSeriesTest, RefusesAcquisitionsThatLieAmongEachOther) {
  const auto with = [&](const std::string& tag, const std::function<int(int)>& value) {
    int number = 0;
    write_stack({0, 1, 2, 3}, Eigen::Matrix3d::Identity(), 0,
                [&](DicomSlice& slice) { slice.elements[tag] = std::to_string(value(number++)); });
    return refusal();
  };
  EXPECT_THAT(with("(0020,0012)", [](int at) { return 1 + at % 2; }),
              HasSubstr("pictures of 2 acquisitions lie among each other (AcquisitionNumber)"));
  EXPECT_THAT(with("(0020,0100)", [](int at) { return 1 + at % 2; }),
              HasSubstr("TemporalPositionIdentifier"));
  // One behind the other, or each slice by itself, is how scanners step through a patient.
  EXPECT_EQ(with("(0020,0012)", [](int at) { return 1 + at / 2; }), "");
  EXPECT_EQ(with("(0020,0012)", [](int at) { return 1 + at; }), "");
}

// Every second file did not come: the gaps are even, and twice as wide as the scanner says.
TEST_F(DicomSeriesTest, SlicesThatLieWiderApartThanTheirHeadersSayAreRefusedOrTakenWithAFinding) {
  write_stack({0, 5, 10, 15}, Eigen::Matrix3d::Identity(), 0, [](DicomSlice& slice) {
    slice.elements["(0018,0088)"] = "2.5";
    slice.elements["(0018,0050)"] = "2.5";
  });
  EXPECT_THAT(refusal(), HasSubstr("its slices lie 5 mm apart, and their headers say 2.5 mm "
                                   "(SpacingBetweenSlices): slices between them may be missing"));
  const DicomVolume taken = read(true);
  EXPECT_EQ(taken.volume.grid.size[2], 4U);
  EXPECT_THAT(taken.findings,
              ElementsAre(HasSubstr("thick and lie 5 mm apart"), HasSubstr("may be missing")));
}

TEST_F(DicomSeriesTest, SaysThatPicturesAreMissingAtTheEnd) {
  int number = 0;
  write_stack({0, 1, 2}, Eigen::Matrix3d::Identity(), 0, [&](DicomSlice& slice) {
    slice.elements["(0020,1002)"] = "40";
    slice.elements["(0020,0013)"] = std::to_string(++number);
  });
  EXPECT_THAT(read().findings, ElementsAre(HasSubstr("has 40 pictures (ImagesInAcquisition), of which 3 are "
                                                     "here")));
  number = 0;
  write_stack({0, 1, 2}, Eigen::Matrix3d::Identity(), 0, [&](DicomSlice& slice) {
    number += 2;
    slice.elements["(0020,0013)"] = std::to_string(number);
  });
  EXPECT_THAT(read().findings,
              ElementsAre(HasSubstr("numbered from 2 to 6 (InstanceNumber), and 3 are here")));
}

TEST_F(DicomSeriesTest, AHoleThatIsResampledOverIsToldAndALargeOneRefused) {
  write_stack({0, 2, 4, 8, 10});
  EXPECT_THAT(read(true).findings,
              ElementsAre(HasSubstr("4 mm were not measured: what is there was made up")));
  write_stack({0, 2, 4, 14, 16});
  EXPECT_THAT(refusal(true), HasSubstr("too much is missing to be resampled over"));
}

TEST_F(DicomSeriesTest, SaysThatPicturesWereCompressedWithLoss) {
  write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, [](DicomSlice& slice) {
    slice.elements["(0028,2110)"] = "01";
    slice.elements["(0028,2112)"] = "40";
  });
  EXPECT_THAT(read().findings, ElementsAre(HasSubstr("compressed with loss, 1 to 40")));
}

// Two patients under one SeriesInstanceUID were one volume.
TEST_F(DicomSeriesTest, RefusesPicturesOfTwoPatientsUnderOneSeries) {
  const auto with = [&](const std::string& tag, const std::string& one, const std::string& other) {
    int number = 0;
    write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0,
                [&](DicomSlice& slice) { slice.elements[tag] = ++number == 1 ? one : other; });
    return refusal();
  };
  EXPECT_EQ(with("(0010,0020)", "4711", "4711"), "");
  const std::string of_patients = with("(0010,0020)", "4711", "4712");
  EXPECT_THAT(of_patients, HasSubstr("slice90.dcm and slice89.dcm differ in whose they are (PatientID)"));
  EXPECT_THAT(of_patients, testing::Not(HasSubstr("471")));
  EXPECT_THAT(with("(0010,0020)", "4711", ""), HasSubstr("(PatientID): they may be of two patients;"));
  EXPECT_THAT(with("(0010,0010)", "Abe^Akiko", "Baba^Emi"),
              HasSubstr("(PatientName): they may be of two patients;"));
  EXPECT_THAT(with("(0010,0010)", "Abe^Akiko", ""), HasSubstr("(PatientName)"));
  EXPECT_THAT(with("(0010,0010)", "Abe^Akiko", "Abe^Akiko^M"), HasSubstr("(PatientName)"));
  EXPECT_THAT(with("(0020,000d)", "1.2.9.1", "1.2.9.2"), HasSubstr("their study (StudyInstanceUID)"));
  EXPECT_THAT(with("(0020,0052)", "1.2.8.1", "1.2.8.2"), HasSubstr("(FrameOfReferenceUID)"));
}

// Some systems write all five parts of a name, and all three writings.
TEST_F(DicomSeriesTest, TakesANameAsTheSameWhateverEmptyPartsFollow) {
  for (const char* const same : {"DOE^JOHN^^", "DOE^JOHN^^^", "DOE^JOHN ", "DOE^JOHN^ =", "DOE^JOHN^=^="}) {
    int number = 0;
    write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, [&](DicomSlice& slice) {
      slice.elements["(0010,0010)"] = ++number == 1 ? "DOE^JOHN" : same;
    });
    EXPECT_EQ(refusal(), "") << same;
  }
}

TEST_F(DicomSeriesTest, RefusesSeveralSeriesWithTheirListUnlessOneIsChosen) {
  for (const std::string uid : {"1.2.77", "1.2.78"}) {
    std::filesystem::create_directory(folder() / uid);
    for (int number = 0; number < (uid == "1.2.77" ? 2 : 3); ++number) {
      DicomSlice slice = slice_at(Vector3(0, 0, number), Eigen::Matrix3d::Identity(), number);
      slice.series_uid = uid;
      slice.description = "kernel " + uid.substr(5);
      write_dicom(folder() / uid / std::to_string(number), slice);
    }
  }
  std::ofstream(folder() / "README") << "no DICOM";
  EXPECT_THAT(refusal(),
              HasSubstr("it holds 2 series; choose one (--series) by its UID, of which the last digits are "
                        "enough: 1.2.77 (2 pictures, CT, 'kernel 7'); 1.2.78 (3 pictures, CT, 'kernel 8')"));
  EXPECT_THAT(refusal(false, "9"), HasSubstr("no series ends with '9'; there are 1.2.77"));
  EXPECT_EQ(read(false, "78").volume.grid.size[2], 3U);
  EXPECT_EQ(read(false, "1.2.77").volume.grid.size[2], 2U);
  EXPECT_EQ(find_dicom_series(folder()).other_files, 1U);
}

TEST_F(DicomSeriesTest, RefusesDamagedFilesByTheirName) {
  EXPECT_THAT(refusal(), HasSubstr("there is no DICOM picture among its 0 files"));
  write_stack({0, 1, 2});
  const std::filesystem::path file = folder() / "slice89.dcm";
  const auto size = std::filesystem::file_size(file);
  for (std::uintmax_t kept = size - 1; kept > 0; kept -= std::min<std::uintmax_t>(kept, 37)) {
    std::filesystem::resize_file(file, kept);
    EXPECT_THAT(refusal(), HasSubstr("slice89.dcm")) << kept;
  }
  std::ofstream(file) << "no DICOM at all, for all its ending";
  EXPECT_THAT(refusal(), AllOf(HasSubstr("slice89.dcm"), HasSubstr("'DICM'")));
  std::filesystem::remove(file);
  std::filesystem::remove(folder() / "slice88.dcm");
  EXPECT_THAT(refusal(), HasSubstr("one picture alone is no volume"));
  EXPECT_THROW((void)find_dicom_series(folder() / "absent"), IoError);
}

TEST_F(DicomSeriesTest, BecomesAVolumeWithFindings) {
  write_stack({0, 1}, Eigen::Matrix3d::Identity(), 0, [](DicomSlice& slice) {
    slice.elements = {{"(0020,000e)", ""}, {"(0018,5100)", "FFS"}};
    slice.stored[3] = 63536;
  });
  const VolumeFile file = read_volume(folder(), {});
  EXPECT_EQ(file.format, "DICOM");
  EXPECT_EQ(file.patient_position, "FFS");
  EXPECT_EQ(file.instance_uids.size(), 2U);
  EXPECT_THAT(file.findings, testing::Contains(HasSubstr("no SeriesInstanceUID")));
  EXPECT_THAT(file.findings, testing::Contains(HasSubstr("2 voxels are padding")));
  EXPECT_THROW((void)read_volume(folder() / "absent", {}), UsageError);
}

TEST_F(DicomSeriesTest, LinksThatLeadNowhereAreToldByTheirName) {
  const auto refused = [](const std::filesystem::path& path, const auto& read) -> std::string {
    try {
      read(path);
    } catch (const Error& error) {
      return error.what();
    }
    return "not refused";
  };
  const auto volume = [](const std::filesystem::path& path) { (void)read_volume(path, {}); };
  const auto labels = [](const std::filesystem::path& path) { (void)read_label_map(path); };
  std::filesystem::create_symlink("gone", folder() / "link");
  EXPECT_THAT(refused(folder() / "link", volume), HasSubstr("link: it is a link to gone, where"));
  EXPECT_THAT(refused(folder() / "absent", volume), HasSubstr("there is no "));
  std::filesystem::create_symlink("round.nii", folder() / "round.nii");
  EXPECT_THAT(refused(folder() / "round.nii", volume), HasSubstr("cannot read " + folder().string()));
  EXPECT_THAT(refused(folder() / "round.nii", labels), HasSubstr("cannot read " + folder().string()));
  // As git-annex leaves a folder whose files were not fetched.
  EXPECT_THAT(refused(folder(), volume), HasSubstr("2 links of the folder lead nowhere: fetch"));
  write_stack({0, 1});
  EXPECT_THAT(read_volume(folder(), {}).findings,
              testing::Contains(HasSubstr("2 links of the folder lead nowhere; what")));
}

std::string little(std::uint32_t value) {
  std::string bytes;
  for (unsigned shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(value >> shift);
  return bytes;
}
/// The head of an element in explicit VR little endian.
std::string element(const std::string& tag, const std::string& vr, std::uint32_t length) {
  const bool is_long = vr == "SQ";
  return tag + vr + (is_long ? std::string(2, 0) + little(length) : little(length).substr(0, 2));
}
const std::string kPrivate("\xE1\x7F\x10\x10", 4), kItem("\xFE\xFF\x00\xE0", 4);
const std::string kOpen(4, '\xFF');
const std::string kItemEnd("\xFE\xFF\x0D\xE0\0\0\0\0", 8), kSequenceEnd("\xFE\xFF\xDD\xE0\0\0\0\0", 8);

// DCMTK reads them by recursion: such a file ended the program, and with it the planning of everybody.
TEST_F(DicomSeriesTest, SequencesWithoutBottomAreRefused) {
  constexpr int kDeep = 100'000;
  write_stack({0, 2.5});
  std::ofstream file(folder() / "slice90.dcm", std::ios::binary | std::ios::app);
  for (int level = 0; level < kDeep; ++level) file << element(kPrivate, "SQ", 0xFFFFFFFF) << kItem << kOpen;
  file.close();
  EXPECT_THAT(refusal(), HasSubstr("lie more than 64 deep within each other"));
}

// Their lengths may be stated, too.
TEST_F(DicomSeriesTest, SequencesOfStatedLengthsWithoutBottomAreRefused) {
  constexpr std::uint32_t kDeep = 60'000, kHead = 12, kItemHead = 8;
  write_stack({0, 2.5});
  std::ofstream file(folder() / "slice90.dcm", std::ios::binary | std::ios::app);
  for (std::uint32_t left = kDeep; left > 0; --left) {
    const std::uint32_t within = (left - 1) * (kHead + kItemHead);
    file << element(kPrivate, "SQ", within + kItemHead) << kItem << little(within);
  }
  file.close();
  EXPECT_THAT(refusal(), HasSubstr("lie more than 64 deep within each other"));
}

/// A file with that meta information, whose length it states, and that data set.
void write_dicom(const std::filesystem::path& file, const std::string& meta, const std::string& data,
                 std::uint32_t stated_bytes) {
  std::ofstream out(file, std::ios::binary);
  out << std::string(128, 0) << "DICM" << element(std::string("\x02\x00\x00\x00", 4), "UL", 4)
      << little(stated_bytes) << meta << data;
}
std::string syntax(const std::string& name) {
  return element(std::string("\x02\x00\x10\x00", 4), "UI", static_cast<std::uint32_t>(name.size())) + name;
}
std::string deflated(const std::string& data) {
  z_stream stream{};
  EXPECT_EQ(::deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::string text = data, out(::deflateBound(&stream, data.size()), 0);
  stream.next_in = reinterpret_cast<Bytef*>(text.data());
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(::deflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(out.size() - stream.avail_out);
  ::deflateEnd(&stream);
  return out;
}

// What is looked at before must be what DCMTK reads then: each of these was read otherwise, and ended the
// program.
TEST_F(DicomSeriesTest, MetaInformationThatCanBeReadInTwoWaysIsRefused) {
  std::string deep;
  for (int level = 0; level < 100'000; ++level) deep += element(kPrivate, "SQ", 0xFFFFFFFF) + kItem + kOpen;
  const std::string plain = syntax(std::string("1.2.840.10008.1.2.1\0", 20)),
                    packed = syntax("1.2.840.10008.1.2.1.99"),
                    padded = syntax("1.2.840.10008.1.2.1.99" + std::string(58, 0)),
                    implicit = std::string("\x02\x00\x10\x00", 4) + little(22) + "1.2.840.10008.1.2.1.99",
                    foreign = syntax(std::string("1.2.840.113619.5.2"));
  const auto refused_as = [&](const std::string& meta, const std::string& data, std::size_t stated) {
    write_dicom(folder() / "0.dcm", meta, data, static_cast<std::uint32_t>(stated));
    return refusal();
  };
  const auto odd = HasSubstr("its file meta information is damaged, and names a deflated encoding");
  EXPECT_THAT(refused_as(plain + packed, deep, plain.size() + packed.size()), odd);
  EXPECT_THAT(refused_as(plain + packed, deep, plain.size()), odd);
  EXPECT_THAT(refused_as(packed + plain, deflated(deep), plain.size() + packed.size()), odd);
  EXPECT_THAT(refused_as(padded, deflated(deep), padded.size()), odd);
  EXPECT_THAT(refused_as(implicit, deflated(deep), implicit.size()), odd);
  EXPECT_THAT(refused_as(foreign, deep, foreign.size()), HasSubstr("in which they are not followed"));
}

// Contours of radiotherapy are thousands of items beside each other.
TEST_F(DicomSeriesTest, ManyItemsBesideEachOtherAreRead) {
  write_stack({0, 2.5});
  std::ofstream file(folder() / "slice90.dcm", std::ios::binary | std::ios::app);
  file << element(kPrivate, "SQ", 0xFFFFFFFF);
  for (int item = 0; item < 5'000; ++item) {
    file << kItem << kOpen << element(kPrivate, "SQ", 0xFFFFFFFF) << kItem << kOpen << kItemEnd
         << kSequenceEnd << kItemEnd;
  }
  file << kSequenceEnd;
  file.close();
  EXPECT_EQ(read().volume.grid.size[2], 2U);
}

// 300 KB that become 300 MB, in each of thousands of files.
TEST_F(DicomSeriesTest, WhatInflatesToMoreThanAPictureIsRefused) {
  std::string meta = element(std::string("\x02\x00\x10\x00", 4), "UI", 22) + "1.2.840.10008.1.2.1.99";
  std::ofstream file(folder() / "0.dcm", std::ios::binary);
  file << std::string(128, 0) << "DICM" << element(std::string("\x02\x00\x00\x00", 4), "UL", 4)
       << little(static_cast<std::uint32_t>(meta.size())) << meta;
  z_stream stream{};
  ASSERT_EQ(::deflateInit2(&stream, 1, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::vector<unsigned char> zeros(1U << 20U), out(1U << 16U);
  for (int mebibyte = 0; mebibyte <= 256; ++mebibyte) {
    stream.next_in = zeros.data();
    stream.avail_in = static_cast<uInt>(zeros.size());
    do {
      stream.next_out = out.data();
      stream.avail_out = static_cast<uInt>(out.size());
      ::deflate(&stream, mebibyte == 256 ? Z_FINISH : Z_NO_FLUSH);
      file.write(reinterpret_cast<const char*>(out.data()),
                 static_cast<std::streamsize>(out.size() - stream.avail_out));
    } while (stream.avail_out == 0);
  }
  ::deflateEnd(&stream);
  file.close();
  EXPECT_THAT(refusal(), HasSubstr("it inflates to more than 256 MiB"));
}

}  // namespace
}  // namespace kiroku::sim
