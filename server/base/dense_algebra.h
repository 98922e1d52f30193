#pragma once

#include <Eigen/Dense>

/// dense_algebra.cpp compiles Eigen's decompositions and products of matrices of doubles once.
/// Every source includes this header precompiled, so no other source compiles them again. Compiling
/// them takes the larger half of the time of a build.

#ifndef TRAMMEL_DENSE_ALGEBRA
#define TRAMMEL_DENSE_ALGEBRA extern template
#endif

namespace Eigen {

TRAMMEL_DENSE_ALGEBRA class LLT<MatrixXd>;
TRAMMEL_DENSE_ALGEBRA class LDLT<MatrixXd>;
TRAMMEL_DENSE_ALGEBRA class PartialPivLU<MatrixXd>;
TRAMMEL_DENSE_ALGEBRA class HouseholderQR<MatrixXd>;
TRAMMEL_DENSE_ALGEBRA class ColPivHouseholderQR<MatrixXd>;
TRAMMEL_DENSE_ALGEBRA class CompleteOrthogonalDecomposition<MatrixXd>;
TRAMMEL_DENSE_ALGEBRA class SelfAdjointEigenSolver<MatrixXd>;
TRAMMEL_DENSE_ALGEBRA class SelfAdjointEigenSolver<Matrix3d>;
TRAMMEL_DENSE_ALGEBRA class JacobiSVD<MatrixXd>;
TRAMMEL_DENSE_ALGEBRA class JacobiSVD<Matrix3Xd>;
TRAMMEL_DENSE_ALGEBRA class JacobiSVD<Matrix3d>;

namespace internal {

using MatrixKernel = gebp_traits<double, double>;
using ReadColumns = const_blas_data_mapper<double, Index, ColMajor>;
using ReadRows = const_blas_data_mapper<double, Index, RowMajor>;

// Products of matrices: the kernel, and how each factor is packed for it.
TRAMMEL_DENSE_ALGEBRA struct gebp_kernel<double, double, Index,
                                         blas_data_mapper<double, Index, ColMajor, Unaligned, 1>,
                                         MatrixKernel::mr, MatrixKernel::nr, false, false>;
TRAMMEL_DENSE_ALGEBRA struct gemm_pack_lhs<double, Index, ReadColumns, MatrixKernel::mr,
                                           MatrixKernel::LhsProgress,
                                           MatrixKernel::LhsPacket4Packing, ColMajor>;
TRAMMEL_DENSE_ALGEBRA struct gemm_pack_lhs<double, Index, ReadRows, MatrixKernel::mr,
                                           MatrixKernel::LhsProgress,
                                           MatrixKernel::LhsPacket4Packing, RowMajor>;
TRAMMEL_DENSE_ALGEBRA struct gemm_pack_rhs<double, Index, ReadColumns, MatrixKernel::nr, ColMajor>;
TRAMMEL_DENSE_ALGEBRA struct gemm_pack_rhs<double, Index, ReadRows, MatrixKernel::nr, RowMajor>;

// Products of a matrix and a vector.
TRAMMEL_DENSE_ALGEBRA struct general_matrix_vector_product<Index, double, ReadColumns, ColMajor,
                                                           false, double, ReadRows, false>;
TRAMMEL_DENSE_ALGEBRA struct general_matrix_vector_product<Index, double, ReadRows, RowMajor, false,
                                                           double, ReadColumns, false>;

// Triangular systems with several right sides.
TRAMMEL_DENSE_ALGEBRA struct triangular_solve_matrix<double, Index, OnTheLeft, Lower, false,
                                                     ColMajor, ColMajor, 1>;
TRAMMEL_DENSE_ALGEBRA struct triangular_solve_matrix<double, Index, OnTheLeft, Lower, false,
                                                     RowMajor, ColMajor, 1>;
TRAMMEL_DENSE_ALGEBRA struct triangular_solve_matrix<double, Index, OnTheLeft, Upper, false,
                                                     ColMajor, ColMajor, 1>;
TRAMMEL_DENSE_ALGEBRA struct triangular_solve_matrix<double, Index, OnTheLeft, Upper, false,
                                                     RowMajor, ColMajor, 1>;

}  // namespace internal
}  // namespace Eigen
