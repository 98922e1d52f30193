// Our own loops beside Eigen and OpenBLAS on the same numbers in one run, one thread each: the
// inverse of a covariance with its solutions, the inverse of a Cholesky factor, AᵀB of tall
// matrices, and a tile of a kernel. `numerics_benchmark` and the options of Google Benchmark.
// OpenBLAS (package libopenblas0-pthread) is looked for when the program starts; without it its
// rows are left out. Eigen is compiled for the processors that the package must run on. The program
// first checks that all agree.
#include <benchmark/benchmark.h>
#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "server/base/check.h"
#include "server/numerics/aligned_matrix.h"
#include "server/numerics/numerics.h"
#include "server/numerics/product.h"
#include "tests/bias/bias_data.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The functions of OpenBLAS that are measured, by their Fortran names.
struct OpenBlas {
  void (*factorise)(const char*, const int*, double*, const int*, int*) = nullptr;  // dpotrf
  void (*invert)(const char*, const int*, double*, const int*, int*) = nullptr;     // dpotri
  void (*invert_triangle)(const char*, const char*, const int*, double*, const int*,
                          int*) = nullptr;  // dtrtri
  void (*multiply)(const char*, const char*, const int*, const int*, const int*, const double*,
                   const double*, const int*, const double*, const int*, const double*, double*,
                   const int*) = nullptr;  // dgemm

  static const OpenBlas* find() {
    static const OpenBlas found = load();
    return found.multiply == nullptr ? nullptr : &found;
  }

 private:
  static OpenBlas load() {
    OpenBlas blas;
    void* library = dlopen("libopenblas.so.0", RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) return blas;
    const auto symbol = [&](const char* name) {
      void* found = dlsym(library, name);
      TRAMMEL_CHECK(found != nullptr);
      return found;
    };
    reinterpret_cast<void (*)(int)>(symbol("openblas_set_num_threads"))(1);
    blas.factorise = reinterpret_cast<decltype(blas.factorise)>(symbol("dpotrf_"));
    blas.invert = reinterpret_cast<decltype(blas.invert)>(symbol("dpotri_"));
    blas.invert_triangle = reinterpret_cast<decltype(blas.invert_triangle)>(symbol("dtrtri_"));
    blas.multiply = reinterpret_cast<decltype(blas.multiply)>(symbol("dgemm_"));
    return blas;
  }
};

/// A covariance as learning has it: a squared exponential of random poses, and noise.
MatrixXd covariance(Index n) {
  const MatrixXd q = random_joints(n, 1);
  MatrixXd m(n, n);
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) m(i, j) = std::exp(-0.5 * (q.row(i) - q.row(j)).squaredNorm());
  }
  m.diagonal().array() += 0.01;
  return m;
}

// ---- M⁻¹ and M⁻¹ Y: what a likelihood with its gradient takes
// ----------------------------------------------------

constexpr Index kOutputs = 3;

/// Ours: the lower triangle of [M Yᵀ; Y 0] becomes [-M⁻¹ .; Y M⁻¹ .].
struct Augmented {
  Augmented(const MatrixXd& m, const MatrixXd& y)
      : n(m.rows()),
        padded(padded_rows(n + y.cols())),
        start(padded, padded),
        matrix(padded, padded),
        work(numerics().work_size(n + y.cols()), 1) {
    start.map().topLeftCorner(n, n) = m.triangularView<Eigen::Lower>();
    start.map().block(n, 0, y.cols(), n) = y.transpose();
  }
  void sweep() {
    matrix.map() = start.map();
    double log_det = 0;
    TRAMMEL_CHECK(numerics().sweep(n, kOutputs, matrix.data(), padded, work.data(), &log_det));
  }
  void inverse_root() {
    matrix.map() = start.map();
    double log_det = 0;
    TRAMMEL_CHECK(
        numerics().inverse_root(n, kOutputs, matrix.data(), padded, work.data(), &log_det));
  }
  Index n, padded;
  AlignedMatrix start, matrix, work;
};

MatrixXd inverse_by_eigen(const MatrixXd& m) {
  return Eigen::LLT<MatrixXd>(m).solve(MatrixXd::Identity(m.rows(), m.cols()));
}

/// Lower triangle; `m` is overwritten.
void inverse_by_openblas(const OpenBlas& blas, MatrixXd* m) {
  const int n = static_cast<int>(m->rows());
  int info = 0;
  blas.factorise("L", &n, m->data(), &n, &info);
  TRAMMEL_CHECK(info == 0);
  blas.invert("L", &n, m->data(), &n, &info);
  TRAMMEL_CHECK(info == 0);
}

void root_by_openblas(const OpenBlas& blas, MatrixXd* m) {
  const int n = static_cast<int>(m->rows());
  int info = 0;
  blas.factorise("L", &n, m->data(), &n, &info);
  TRAMMEL_CHECK(info == 0);
  blas.invert_triangle("L", "N", &n, m->data(), &n, &info);
  TRAMMEL_CHECK(info == 0);
}

MatrixXd root_by_eigen(const MatrixXd& m) {
  return Eigen::LLT<MatrixXd>(m).matrixL().solve(MatrixXd::Identity(m.rows(), m.cols()));
}

MatrixXd product_by_openblas(const OpenBlas& blas, const MatrixXd& a, const MatrixXd& b) {
  MatrixXd c(a.cols(), b.cols());
  const int m = static_cast<int>(a.cols());
  const int n = static_cast<int>(b.cols());
  const int k = static_cast<int>(a.rows());
  const double one = 1;
  const double zero = 0;
  blas.multiply("T", "N", &m, &n, &k, &one, a.data(), &k, b.data(), &k, &zero, c.data(), &m);
  return c;
}

/// Flops per second, so that the sizes can be told from each other.
void count(benchmark::State& state, double flops) {
  state.counters["Gflop/s"] = benchmark::Counter(
      flops * 1e-9, benchmark::Counter::kIsIterationInvariantRate, benchmark::Counter::kIs1000);
}

double cube(const benchmark::State& state) {
  return std::pow(static_cast<double>(state.range(0)), 3);
}

void inverse_ours(benchmark::State& state) {
  const Index n = state.range(0);
  Augmented augmented(covariance(n), random_joints(n, 2, kOutputs));
  for (auto _ : state) augmented.sweep();
  count(state, cube(state));
}

void inverse_eigen(benchmark::State& state) {
  const MatrixXd m = covariance(state.range(0));
  const MatrixXd y = random_joints(state.range(0), 2, kOutputs);
  for (auto _ : state) {
    const MatrixXd inverse = inverse_by_eigen(m);
    const MatrixXd solution = inverse * y;
    benchmark::DoNotOptimize(solution.data());
  }
  count(state, cube(state));
}

void inverse_openblas(benchmark::State& state) {
  const OpenBlas* blas = OpenBlas::find();
  const MatrixXd m = covariance(state.range(0));
  const MatrixXd y = random_joints(state.range(0), 2, kOutputs);
  MatrixXd inverse;
  for (auto _ : state) {
    inverse = m;
    inverse_by_openblas(*blas, &inverse);
    const MatrixXd solution = inverse.selfadjointView<Eigen::Lower>() * y;
    benchmark::DoNotOptimize(solution.data());
  }
  count(state, cube(state));
}

void root_ours(benchmark::State& state) {
  const Index n = state.range(0);
  Augmented augmented(covariance(n), random_joints(n, 2, kOutputs));
  for (auto _ : state) augmented.inverse_root();
  count(state, 2.0 / 3.0 * cube(state));
}

void root_eigen(benchmark::State& state) {
  const MatrixXd m = covariance(state.range(0));
  for (auto _ : state) {
    const MatrixXd root = root_by_eigen(m);
    benchmark::DoNotOptimize(root.data());
  }
  count(state, 2.0 / 3.0 * cube(state));
}

void root_openblas(benchmark::State& state) {
  const OpenBlas* blas = OpenBlas::find();
  const MatrixXd m = covariance(state.range(0));
  MatrixXd root;
  for (auto _ : state) {
    root = m;
    root_by_openblas(*blas, &root);
    benchmark::DoNotOptimize(root.data());
  }
  count(state, 2.0 / 3.0 * cube(state));
}

// ---- AᵀB of tall matrices: what a scan of candidates takes
// -------------------------------------------------------

/// As diagnosis has them: three rows a pose, some tens of columns.
struct Tall {
  explicit Tall(const benchmark::State& state)
      : a(random_joints(state.range(0), 3, state.range(1))),
        b(random_joints(state.range(0), 4, state.range(2))) {}
  [[nodiscard]] double flops() const {
    return 2.0 * static_cast<double>(a.rows() * a.cols() * b.cols());
  }
  MatrixXd a, b;
};

void product_ours(benchmark::State& state) {
  const Tall tall(state);
  for (auto _ : state) benchmark::DoNotOptimize(transposed_product(tall.a, tall.b).data());
  count(state, tall.flops());
}

void product_eigen(benchmark::State& state) {
  const Tall tall(state);
  for (auto _ : state) benchmark::DoNotOptimize(MatrixXd(tall.a.transpose() * tall.b).data());
  count(state, tall.flops());
}

void product_openblas(benchmark::State& state) {
  const Tall tall(state);
  for (auto _ : state)
    benchmark::DoNotOptimize(product_by_openblas(*OpenBlas::find(), tall.a, tall.b).data());
  count(state, tall.flops());
}

// ---- a tile of a kernel
// ------------------------------------------------------------------------------------------

constexpr Index kTileRows = 240;
constexpr Index kTileColumns = 64;

/// z and |z|²/2 of random poses, padded.
MatrixXd features(Index rows, std::uint64_t seed) {
  MatrixXd table = MatrixXd::Zero(padded_rows(rows), 7);
  table.topLeftCorner(rows, 6) = random_joints(rows, seed);
  table.col(6) = 0.5 * table.leftCols(6).rowwise().squaredNorm();
  return table;
}

void tile_by_numerics(const MatrixXd& a, const MatrixXd& b, MatrixXd* k) {
  numerics().radial_tile(RadialShape::kSquaredExponential, 6, kTileRows, a.data(), a.rows(),
                         kTileColumns, b.data(), b.rows(), k->data(), k->rows());
}

void tile_by_eigen(const MatrixXd& a, const MatrixXd& b, MatrixXd* k) {
  const auto z = a.topLeftCorner(kTileRows, 6);
  k->noalias() = z * b.topLeftCorner(kTileColumns, 6).transpose();
  k->colwise() -= a.col(6).head(kTileRows);
  k->rowwise() -= b.col(6).head(kTileColumns).transpose();
  *k = k->array().exp().matrix().eval();
}

template <void (*tile)(const MatrixXd&, const MatrixXd&, MatrixXd*)>
void kernel_tile(benchmark::State& state) {
  const MatrixXd a = features(kTileRows, 5);
  const MatrixXd b = features(kTileColumns, 6);
  MatrixXd k(kTileRows, kTileColumns);
  for (auto _ : state) {
    tile(a, b, &k);
    benchmark::DoNotOptimize(k.data());
  }
  state.SetItemsProcessed(state.iterations() * kTileRows * kTileColumns);
}

double farthest(const MatrixXd& a, const MatrixXd& b) { return (a - b).cwiseAbs().maxCoeff(); }

/// Ends the program where two of them do not agree.
void check_agreement() {
  const Index n = 300;
  const MatrixXd m = covariance(n);
  Augmented augmented(m, random_joints(n, 2, kOutputs));
  augmented.sweep();
  const auto lower = [&](const MatrixXd& full) -> MatrixXd {
    return full.triangularView<Eigen::Lower>();
  };
  const MatrixXd inverse = lower(-augmented.matrix.map().topLeftCorner(n, n));
  augmented.inverse_root();
  const MatrixXd root = lower(augmented.matrix.map().topLeftCorner(n, n));
  const MatrixXd a = random_joints(999, 3, 40), b = random_joints(999, 4, 20);
  const double size = inverse.cwiseAbs().maxCoeff();
  TRAMMEL_CHECK(farthest(inverse, lower(inverse_by_eigen(m))) < 1e-9 * size);
  TRAMMEL_CHECK(farthest(root, lower(root_by_eigen(m))) < 1e-9 * size);
  TRAMMEL_CHECK(farthest(transposed_product(a, b), a.transpose() * b) < 1e-10);
  MatrixXd ours(kTileRows, kTileColumns), eigens(kTileRows, kTileColumns);
  tile_by_numerics(features(kTileRows, 5), features(kTileColumns, 6), &ours);
  tile_by_eigen(features(kTileRows, 5), features(kTileColumns, 6), &eigens);
  TRAMMEL_CHECK(farthest(ours, eigens) < 1e-14);
  const OpenBlas* blas = OpenBlas::find();
  if (blas == nullptr) return;
  MatrixXd theirs = m;
  inverse_by_openblas(*blas, &theirs);
  TRAMMEL_CHECK(farthest(inverse, lower(theirs)) < 1e-9 * size);
  theirs = m;
  root_by_openblas(*blas, &theirs);
  TRAMMEL_CHECK(farthest(root, lower(theirs)) < 1e-9 * size);
  TRAMMEL_CHECK(farthest(transposed_product(a, b), product_by_openblas(*blas, a, b)) < 1e-10);
}

void add(const char* name, void (*run)(benchmark::State&),
         const std::vector<std::vector<std::int64_t>>& sizes) {
  auto* one = benchmark::RegisterBenchmark(name, run)->Unit(benchmark::kMillisecond);
  for (const auto& size : sizes) one->Args(size);
}

void add_all() {
  const std::vector<std::vector<std::int64_t>> squares = {{150}, {450}, {1000}, {2500}};
  const std::vector<std::vector<std::int64_t>> tall = {
      {600, 30, 6}, {3000, 60, 60}, {3000, 100, 4}};
  const bool blas = OpenBlas::find() != nullptr;
  add("inverse/ours", inverse_ours, squares);
  add("inverse/eigen", inverse_eigen, squares);
  if (blas) add("inverse/openblas", inverse_openblas, squares);
  add("inverse_root/ours", root_ours, squares);
  add("inverse_root/eigen", root_eigen, squares);
  if (blas) add("inverse_root/openblas", root_openblas, squares);
  add("transposed_product/ours", product_ours, tall);
  add("transposed_product/eigen", product_eigen, tall);
  if (blas) add("transposed_product/openblas", product_openblas, tall);
  benchmark::RegisterBenchmark("kernel_tile/ours", kernel_tile<tile_by_numerics>);
  benchmark::RegisterBenchmark("kernel_tile/eigen", kernel_tile<tile_by_eigen>);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  trammel::check_agreement();
  std::printf("numerics: build %s%s\n", trammel::numerics().name,
              trammel::OpenBlas::find() == nullptr
                  ? "; OpenBLAS is not installed, its rows are left out"
                  : "");
  trammel::add_all();
  benchmark::RunSpecifiedBenchmarks();
}
