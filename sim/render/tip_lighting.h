// How the light at an endoscope's tip lights wet tissue. Pure, thread-safe.
//
// Numbers are linear in light: colours are decoded by kPictureGamma, and the picture is encoded by it at the
// end, so that a place at twice the distance has a quarter of the light. With l, v and n towards the light,
// the eye and the tissue's outside, and h half way between l and v, the light that comes back is
//
//   E (c (ambient + diffuse n.l) + wet W),   E = (working distance / distance)^2
//   W = pi D F G / (4 n.l n.v) n.l,   D = a^2 / (pi (n.h^2 (a^2 - 1) + 1)^2),   a = roughness^2
//   F = F0 + (1 - F0) (1 - l.h)^5,    G / (n.l n.v) = 1 / l.h^2
//
// Sources: D is GGX (Walter, Marschner, Li and Torrance, "Microfacet Models for Refraction through Rough
// Surfaces", EGSR 2007), F Schlick's ("An Inexpensive BRDF Model for Physically-Based Rendering", Computer
// Graphics Forum 1994), G Kelemen and Szirmay-Kalos's ("A Microfacet Based Coupled Specular-Matte BRDF
// Model", Eurographics 2001). The factor pi stands for a light that is 1 on white tissue that faces it.
#pragma once

#include "sim/render/picture.h"
#include "sim/render/scene.h"

namespace kiroku::sim {

/// What a number of a picture is raised to for its light.
inline constexpr double kPictureGamma = 2.2;
/// What a film of water reflects straight on: ((n - 1) / (n + 1))^2 with n = 1.333.
inline constexpr double kWaterReflectance = 0.0204;
/// Steel and other tools, which are no tissue, keep a highlight of Blinn's; its exponent and share.
inline constexpr double kSolidShininess = 40, kSolidGloss = 0.35;

double linear_light(double encoded);
double encoded_light(double linear);
Vector3 linear_light(const Rgb& colour);

/// The light at a place in the view's axes.
struct TipRay {
  Vector3 to_light;
  double brightness;
};
TipRay tip_ray(const TipLight& light, const Vector3& view_m);

/// W of the film; 0 where the tissue's outside is turned away from the light. All of length 1.
double wet_highlight(const Vector3& normal, const Vector3& to_light, const Vector3& to_eye, double roughness);

/// What is beyond the disc of a round picture becomes black; its border is soft over a hundredth of it.
void blacken_beyond_disc(Picture& picture);
/// Whether a pixel is beyond it, and so black whatever is drawn.
bool is_beyond_disc(int width, int height, int x, int y);

}  // namespace kiroku::sim
