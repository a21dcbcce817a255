#include "media/quality/colour_difference.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::media {
namespace {

struct Pair {
  Lab one, other;
  double apart;
};
// Sharma, Wu and Dalal, Color Research and Application 30(1), 2005, table 1: all 34 pairs.
const std::vector<Pair> kPublished{{{50.0000, 2.6772, -79.7751}, {50.0000, 0.0000, -82.7485}, 2.0425},
                                   {{50.0000, 3.1571, -77.2803}, {50.0000, 0.0000, -82.7485}, 2.8615},
                                   {{50.0000, 2.8361, -74.0200}, {50.0000, 0.0000, -82.7485}, 3.4412},
                                   {{50.0000, -1.3802, -84.2814}, {50.0000, 0.0000, -82.7485}, 1.0000},
                                   {{50.0000, -1.1848, -84.8006}, {50.0000, 0.0000, -82.7485}, 1.0000},
                                   {{50.0000, -0.9009, -85.5211}, {50.0000, 0.0000, -82.7485}, 1.0000},
                                   {{50.0000, 0.0000, 0.0000}, {50.0000, -1.0000, 2.0000}, 2.3669},
                                   {{50.0000, -1.0000, 2.0000}, {50.0000, 0.0000, 0.0000}, 2.3669},
                                   {{50.0000, 2.4900, -0.0010}, {50.0000, -2.4900, 0.0009}, 7.1792},
                                   {{50.0000, 2.4900, -0.0010}, {50.0000, -2.4900, 0.0010}, 7.1792},
                                   {{50.0000, 2.4900, -0.0010}, {50.0000, -2.4900, 0.0011}, 7.2195},
                                   {{50.0000, 2.4900, -0.0010}, {50.0000, -2.4900, 0.0012}, 7.2195},
                                   {{50.0000, -0.0010, 2.4900}, {50.0000, 0.0009, -2.4900}, 4.8045},
                                   {{50.0000, -0.0010, 2.4900}, {50.0000, 0.0010, -2.4900}, 4.8045},
                                   {{50.0000, -0.0010, 2.4900}, {50.0000, 0.0011, -2.4900}, 4.7461},
                                   {{50.0000, 2.5000, 0.0000}, {50.0000, 0.0000, -2.5000}, 4.3065},
                                   {{50.0000, 2.5000, 0.0000}, {73.0000, 25.0000, -18.0000}, 27.1492},
                                   {{50.0000, 2.5000, 0.0000}, {61.0000, -5.0000, 29.0000}, 22.8977},
                                   {{50.0000, 2.5000, 0.0000}, {56.0000, -27.0000, -3.0000}, 31.9030},
                                   {{50.0000, 2.5000, 0.0000}, {58.0000, 24.0000, 15.0000}, 19.4535},
                                   {{50.0000, 2.5000, 0.0000}, {50.0000, 3.1736, 0.5854}, 1.0000},
                                   {{50.0000, 2.5000, 0.0000}, {50.0000, 3.2972, 0.0000}, 1.0000},
                                   {{50.0000, 2.5000, 0.0000}, {50.0000, 1.8634, 0.5757}, 1.0000},
                                   {{50.0000, 2.5000, 0.0000}, {50.0000, 3.2592, 0.3350}, 1.0000},
                                   {{60.2574, -34.0099, 36.2677}, {60.4626, -34.1751, 39.4387}, 1.2644},
                                   {{63.0109, -31.0961, -5.8663}, {62.8187, -29.7946, -4.0864}, 1.2630},
                                   {{61.2901, 3.7196, -5.3901}, {61.4292, 2.2480, -4.9620}, 1.8731},
                                   {{35.0831, -44.1164, 3.7933}, {35.0232, -40.0716, 1.5901}, 1.8645},
                                   {{22.7233, 20.0904, -46.6940}, {23.0331, 14.9730, -42.5619}, 2.0373},
                                   {{36.4612, 47.8580, 18.3852}, {36.2715, 50.5065, 21.2231}, 1.4146},
                                   {{90.8027, -2.0831, 1.4410}, {91.1528, -1.6435, 0.0447}, 1.4441},
                                   {{90.9257, -0.5406, -0.9208}, {88.6381, -0.8985, -0.7239}, 1.5381},
                                   {{6.7747, -0.2908, -2.4247}, {5.8714, -0.0985, -2.2286}, 0.6377},
                                   {{2.0776, 0.0795, -1.1350}, {0.9033, -0.0636, -0.5514}, 0.9082}};

TEST(ColourDifference, IsThatOfAllPublishedPairs) {
  ASSERT_EQ(kPublished.size(), 34U);
  for (const Pair& pair : kPublished) {
    EXPECT_NEAR(ciede2000(pair.one, pair.other), pair.apart, 1e-4)
        << pair.one.lightness << " " << pair.one.a << " " << pair.one.b;
    EXPECT_NEAR(ciede2000(pair.other, pair.one), pair.apart, 1e-4);
  }
}

TEST(ColourDifference, KnowsTheLabOfPrimaries) {
  // sRGB red, green, blue and white under D65, as colour science tabulates them.
  const Lab red = lab_of(255, 0, 0), green = lab_of(0, 255, 0), blue = lab_of(0, 0, 255),
            white = lab_of(255, 255, 255), black = lab_of(0, 0, 0);
  EXPECT_NEAR(red.lightness, 53.24, 0.02);
  EXPECT_NEAR(red.a, 80.09, 0.05);
  EXPECT_NEAR(red.b, 67.20, 0.05);
  EXPECT_NEAR(green.lightness, 87.73, 0.02);
  EXPECT_NEAR(green.a, -86.18, 0.05);
  EXPECT_NEAR(green.b, 83.18, 0.05);
  EXPECT_NEAR(blue.lightness, 32.30, 0.02);
  EXPECT_NEAR(blue.a, 79.19, 0.05);
  EXPECT_NEAR(blue.b, -107.86, 0.05);
  EXPECT_NEAR(white.lightness, 100, 1e-6);
  EXPECT_NEAR(white.a, 0, 1e-6);
  EXPECT_NEAR(white.b, 0, 1e-6);
  EXPECT_NEAR(black.lightness, 0, 1e-9);
}

TEST(ColourDifference, SummarisesAllPixels) {
  // Nineteen of twenty pixels are the same; black against white is 100.
  std::vector<std::uint8_t> one(20 * 3, 0), other = one;
  other[57] = other[58] = other[59] = 255;
  ColourError error;
  error.add({20, 1, 3, one}, {20, 1, 3, other});
  EXPECT_NEAR(error.mean(), 5, 1e-3);
  EXPECT_EQ(error.quantile(0.95), 0);
  EXPECT_NEAR(error.quantile(0.96), 100, 0.011);
  EXPECT_THROW(error.add({20, 1, 3, one}, {10, 2, 3, other}), Error);
}

}  // namespace
}  // namespace kiroku::media
