#pragma once

#include <Eigen/Core>
#include <vector>

#include "imaging/image.h"
#include "scanner/checks/frame_registration.h"

namespace sateen {

// Frames at one size of the pyramid, and the Gauss-Newton step of RegisterFrames() on them. The
// equations are those of frame_registration.h; shifts are in cells of this level.
class RegistrationLevel {
 public:
  // `cells`: how many cells of input.light() one of this level's is wide.
  RegistrationLevel(const std::vector<Image<float>>& frames, const FramesToRegister& input,
                    double cells);

  // Returns whether no tile has lights that tell of a surface.
  [[nodiscard]] bool IsEmpty() const { return tiles_.empty(); }

  // Returns the mean of r of (3) over all cells: how badly the frames fit together at these shifts.
  [[nodiscard]] double Misfit(const std::vector<Eigen::Vector2d>& shifts);

  // Returns the share of the frames' variance that a surface explains, at the shifts of the last
  // Misfit(): 0 where there is only noise.
  [[nodiscard]] double Explained() const { return explained_; }

  // Takes one step of Gauss-Newton from `shifts` and writes their standard deviations, of both axes
  // together. Returns the longest step.
  double Step(std::vector<Eigen::Vector2d>& shifts, std::vector<double>& sd);

 private:
  using Matrix = Eigen::MatrixXd;
  using Vector = Eigen::VectorXd;

  struct Tile {
    int left, top, right, bottom;
    Vector e;         // |e_k|
    Matrix p;         // the projector P
    Matrix n_from_v;  // L (L^T L)^-1
  };

  // A and b of (2), of one tile or of all.
  struct NormalEquations {
    Matrix a;
    Vector b;
  };

  // Returns false where a light is not known, or all lie in one plane.
  bool AddLights(const FramesToRegister& input, const Eigen::Vector2d& cell, Tile& tile) const;
  void Move(const std::vector<Eigen::Vector2d>& shifts);
  // Computes v, r, P v and, where asked, gradients and weights of the known cells of a tile.
  void Gather(const Tile& tile, bool with_gradients);
  bool AddCell(const Tile& tile, int x, int y, Eigen::Index cell, bool with_gradients);
  // Adds one tile's share of (2) and returns its b.
  Vector Accumulate(const Tile& tile, NormalEquations& all) const;
  // Holds d_1 at 0, a and, so that without texture nothing moves, the steps.
  void AddRidge(double variance, Matrix& a) const;
  // s of (3).
  double MisfitScale();

  Eigen::Index count_;
  std::vector<Image<float>> high_;  // the frames, less their local mean
  Image<float> bright_;             // mean of the frames
  std::vector<Tile> tiles_;
  std::vector<Image<float>> moved_;
  double scale_ = 1.0;  // s of (3)
  double explained_ = 0.0;
  // Values of the tile that was gathered last, one row per cell.
  Matrix v_;
  Matrix regressors_;  // -d/dx of each frame, -d/dy of each, N'
  Matrix pv_;
  Vector bright_here_;
  Vector misfit2_;
  Vector r_;
  Vector w_;
};

}  // namespace sateen
