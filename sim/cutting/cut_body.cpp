#include "sim/cutting/cut_body.h"

namespace kiroku::sim {

CutBody::CutBody(const TetMesh& mesh, const Materials& materials, const Constraints& constraints)
    : shape_(mesh, constraints), body_(mesh, materials, constraints) {
  body_.apply({}, {});  // so that the first step is as quick as the others
}

CutShape::Step CutBody::cut(const SweepSurface& sweep) {
  CutShape::Step step = shape_.cut(sweep);
  if (step.changed()) body_.apply(step.cut.change, step.adrift);
  return step;
}

}  // namespace kiroku::sim
