#pragma once

#include "core/error.h"
#include "core/task.h"
#include "imaging/image.h"
#include "rig/camera.h"
#include "solver/normal_field.h"

namespace sateen {

/// Integrates normals to the height of the surface above the table plane at every pixel. A pixel's
/// ray from the camera's centre c meets the table in x_0 and the height z in x = x_0 + (c - x_0) z
/// / c_z. Neighbours x, y lie in a surface orthogonal to n; in the logarithm h of z this is linear:
///
///     h = -c_z ln(1 - z / c_z)                                                                (1)
///     s = (n_x, n_y) / (n . v),  v = (c - x_0) / c_z                                          (2)
///     h(y) - h(x) = -(s(x) + s(y)) / 2 . (x_0(y) - x_0(x))                                    (3)
///     h = argmin of the squared misfits of (3) over all pairs of neighbours with normals;
///     among these h, the one with the least squared differences everywhere                   (4)
///
/// (3) holds for rays of any slant. It leaves out pixels without a normal, and those whose surface
/// is within 6 degrees of edge-on (n . v <= 0.1 |v|). (4) spans them by a membrane, which also
/// places parts that no solved pixels join. The mean of z over the solved pixels is 0.
///
/// field    H x W
/// camera   with a pose, of H x W
/// Returns  z in mm, H x W, also where unsolved
/// Errors   kBadData: sizes disagree; no pose; a pixel that does not see the table
///          kDegenerate: no pixel has a normal; kCancelled
/// Cost     conjugate gradients, preconditioned by the equations without gaps through the cosine
///          transform: 2 steps where all pixels are solved, some 10 and at most 100 where many are
///          not; 0.1 us per pixel and step, 25 bytes per pixel; the same bits for any number of
///          threads
/// Source   (4) without gaps: Simchony, Chellappa and Shao, "Direct analytical methods for solving
///          Poisson equations in computer vision problems", PAMI 12(5), 1990; with gaps: Ghiglia
///          and Romero, "Robust two-dimensional weighted and unweighted phase unwrapping", JOSA A
///          11(1), 1994; logarithm: Durou and Courteille, "Integration of a normal field without
///          boundary condition", PACV 2007. (3) is ours.
[[nodiscard]] Result<Image<float>> IntegrateNormals(const NormalField& field, const Camera& camera,
                                                    const Task& task = {});

}  // namespace sateen
