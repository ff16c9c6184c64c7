#pragma once

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "rig/camera.h"
#include "solver/lambertian.h"

namespace sateen {

/// Height of the surface above the table plane at every pixel, from its normals. With the camera's centre c
/// and x_0 where a pixel's ray meets the table, the ray is at height z in x = x_0 + (c - x_0) z / c_z.
/// Neighbours x, y lie in a surface that is orthogonal to n, for which z by its logarithm is linear:
///
///     h = -c_z ln(1 - z / c_z)                                                                (1)
///     s = (n_x, n_y) / (n . v),  v = (c - x_0) / c_z                                          (2)
///     h(y) - h(x) = -(s(x) + s(y)) / 2 . (x_0(y) - x_0(x))                                    (3)
///     h = argmin of the squared misfits of (3) over all pairs of neighbours that have normals;
///     of all such h the one with the least squared differences everywhere                    (4)
///
/// which holds for rays of any slant. Pixels without a normal, or with one within 6 degrees of the rays' plane
/// (n . v <= 0.1 |v|), take part in no (3): what (4) gives them is a membrane over the gap, and parts
/// that nothing solved joins lie as that membrane has them. The mean of z over the solved pixels is 0.
///
/// field    H x W
/// camera   with a pose, of H x W
/// Returns  z in millimetres, H x W, also where unsolved
/// Errors   kBadData: sizes disagree; no pose; a pixel that does not see the table
///          kDegenerate: no pixel has a normal; kCancelled
/// Cost     conjugate gradients with the equations without gaps for preconditioner, by cosine transform: 2 steps
///          where all pixels are solved, some 10 and at most 100 where many are not; 0.1 us a pixel and step,
///          25 bytes a pixel; the same bits for any number of threads
/// Source   (4) without gaps: Simchony, Chellappa and Shao, "Direct analytical methods for solving Poisson
///          equations in computer vision problems", PAMI 12(5), 1990; with gaps: Ghiglia and Romero, "Robust
///          two-dimensional weighted and unweighted phase unwrapping", JOSA A 11(1), 1994; logarithm: Durou and Courteille,
///          "Integration of a normal field without boundary condition", PACV 2007. (3) is ours.
[[nodiscard]] Result<Image<float>> IntegrateNormals(const NormalField& field, const Camera& camera,
                                                    const Task& task = {});

}  // namespace sateen
