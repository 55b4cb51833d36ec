/// impinge/eigen.hpp: matrices of Eigen as arrays of impinge, without a copy: row-major, column-major, blocks and `Eigen::Ref` of them, maps, and
/// containers of vectors of a fixed size.
/// And answers of impinge as matrices.
#ifndef IMPINGE_EIGEN_HPP
#define IMPINGE_EIGEN_HPP

#include <impinge/impinge.hpp>

#include <Eigen/Core>

namespace impinge {
inline namespace IMPINGE_MODE {

/// Everything of Eigen that lies in memory: one row per position or element.
template <class T>
struct as_array<T, std::enable_if_t<std::is_base_of_v<Eigen::MatrixBase<T>, T> || std::is_base_of_v<Eigen::ArrayBase<T>, T>>> {
  static_assert((static_cast<int>(T::Flags) & Eigen::DirectAccessBit) != 0, "an expression of Eigen has no memory: evaluate it first");
  static array of(const T &matrix, std::size_t columns) {
    using number = typename T::Scalar;
    const auto size = static_cast<std::ptrdiff_t>(sizeof(number));
    const auto n = static_cast<std::size_t>(matrix.rows());
    // An empty matrix, such as one without edges, may have any number of columns. Rows of another length are refused: strides of 1 byte
    // fit no number, and the other one says how long they are.
    const bool fits = n == 0 || static_cast<std::size_t>(matrix.cols()) == columns;
    // Bytes it fits: these pass for larger numbers then.
    const auto type = fits || size > 1 ? detail::type_of<number>() : static_cast<std::uint32_t>(IMPINGE_U32);
    return {matrix.data(), n, fits ? matrix.rowStride() * size : 1, fits ? matrix.colStride() * size : -static_cast<std::ptrdiff_t>(matrix.cols()), type};
  }
};

namespace detail {
/// In containers, vectors of a fixed size are rows: `std::vector<Eigen::Vector3d>`.
template <class T> struct row_of<T, std::enable_if_t<std::is_base_of_v<Eigen::PlainObjectBase<T>, T>>> {
  static_assert(T::IsVectorAtCompileTime && T::SizeAtCompileTime != Eigen::Dynamic, "rows of Eigen are vectors of a fixed size");
  using number = typename T::Scalar;
  static constexpr std::size_t n = static_cast<std::size_t>(T::SizeAtCompileTime);
  static_assert(sizeof(T) == n * sizeof(number), "rows are packed");
};
} // namespace detail

/// The rows of pairs as a matrix of n x 4 unsigned numbers: body_a, element_a, body_b, element_b. A view.
inline Eigen::Map<const Eigen::Matrix<std::uint32_t, Eigen::Dynamic, 4, Eigen::RowMajor>> as_matrix(view<pair> rows) {
  static_assert(sizeof(pair) == 4 * sizeof(std::uint32_t), "rows are packed");
  return {reinterpret_cast<const std::uint32_t *>(rows.data()), static_cast<Eigen::Index>(rows.size()), 4};
}

/// The points that are nearest to those asked about, as a matrix of n x 3 numbers; NaN where nothing is near enough. A view.
inline Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>, Eigen::Unaligned, Eigen::OuterStride<>> points_of(const closest &of) {
  constexpr auto stride = sizeof(closest_element) / sizeof(double);
  static_assert(sizeof(closest_element) % sizeof(double) == 0, "rows are a number of doubles apart");
  return {of.empty() ? nullptr : of.data()->point, static_cast<Eigen::Index>(of.size()), 3, Eigen::OuterStride<>(stride)};
}
void points_of(const closest &&) = delete;

/// Numbers that belong to an answer, such as lists and columns, as a vector. A view.
template <class T> Eigen::Map<const Eigen::Matrix<T, Eigen::Dynamic, 1>> as_vector(view<T> numbers) {
  return {numbers.data(), static_cast<Eigen::Index>(numbers.size())};
}

namespace detail {
/// The columns of an array of the library, whose rows are packed; 0 of what is no number of its type.
inline Eigen::Index columns_of(const array &of, bool of_indices) {
  const bool is_right = of_indices ? of.type == IMPINGE_U32 : of.type == IMPINGE_F32 || of.type == IMPINGE_F64;
  return is_right && of.column_stride > 0 ? of.row_stride / of.column_stride : 0;
}
/// Throws; without exceptions, what is asked for is empty.
inline void misfit(const char *message) {
#ifndef IMPINGE_NO_EXCEPTIONS
  refuse(message);
#else
  (void)message;
#endif
}
} // namespace detail

/// Elements, edges or faces of a body as a matrix of vertex numbers, one row each: `scene::faces` and so on. A view.
inline Eigen::Map<const Eigen::Matrix<std::uint32_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> as_indices(const array &elements) {
  const auto n = detail::columns_of(elements, true);
  if (elements.rows > 0 && n == 0) detail::misfit("as_indices: no vertex numbers");
  return {static_cast<const std::uint32_t *>(elements.data), n == 0 ? 0 : static_cast<Eigen::Index>(elements.rows), n};
}

/// One number per vertex in double precision, such as `safe_distances::of`. A copy.
inline Eigen::VectorXd to_vector(const array &numbers) {
  const auto n = static_cast<Eigen::Index>(numbers.rows);
  if (n > 0 && detail::columns_of(numbers, false) != 1) {
    detail::misfit("to_vector: not one number per row");
    return {};
  }
  if (numbers.type == IMPINGE_F64) return Eigen::Map<const Eigen::VectorXd>(static_cast<const double *>(numbers.data), n);
  return Eigen::Map<const Eigen::VectorXf>(static_cast<const float *>(numbers.data), n).cast<double>();
}

/// Positions or points as a matrix of n x 3 numbers in double precision. A copy. Vertex numbers have `as_indices`, one number per row `to_vector`.
inline Eigen::MatrixXd to_matrix(const array &positions) {
  if (positions.rows > 0 && detail::columns_of(positions, false) < 3) {
    detail::misfit("to_matrix: not three coordinates per row: as_indices is for vertex numbers, to_vector for one number per row");
    return Eigen::MatrixXd(0, 3);
  }
  using strides = Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>;
  using wide = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
  using narrow = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
  const auto n = static_cast<Eigen::Index>(positions.rows);
  const auto stride = [&](std::size_t size) {
    const auto bytes = static_cast<std::ptrdiff_t>(size);
    return strides(positions.row_stride / bytes, positions.column_stride / bytes);
  };
  if (n == 0) return Eigen::MatrixXd(0, 3);
  if (positions.type == IMPINGE_F64)
    return Eigen::Map<const wide, Eigen::Unaligned, strides>(static_cast<const double *>(positions.data), n, 3, stride(sizeof(double)));
  return Eigen::Map<const narrow, Eigen::Unaligned, strides>(static_cast<const float *>(positions.data), n, 3, stride(sizeof(float))).cast<double>();
}

} // namespace IMPINGE_MODE
} // namespace impinge

#endif // IMPINGE_EIGEN_HPP
