#include "server/compensate/file/json_values.h"

namespace trammel::model_file {

Json matrix_json(const Eigen::Ref<const Eigen::MatrixXd>& m) {
  Json values = Json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = 0; j < m.cols(); ++j) values.push_back(m(i, j));
  }
  return {{"rows", m.rows()}, {"columns", m.cols()}, {"values", std::move(values)}};
}

Json pose_json(const Pose& X) { return matrix_json(Eigen::MatrixXd(X.matrix().topRows<3>())); }

void wrong(const char* what, const Json& json) {
  throw Json::other_error::create(501, what, &json);
}

double number_from(const Json& json) {
  if (!json.is_number() || !std::isfinite(json.get<double>()))
    wrong("expected a finite number", json);
  return json.get<double>();
}
double number_from(const Json& json, const char* key) { return number_from(json.at(key)); }

int count_from(const Json& json, const char* key) {
  const int count = whole_from<int>(json, key);
  if (count < 0) wrong("a count below 0", json);
  return count;
}

const Json& list_from(const Json& json) {
  if (!json.is_array()) wrong("expected a list", json);
  return json;
}

std::vector<double> numbers_from(const Json& json) {
  std::vector<double> numbers;
  for (const Json& one : list_from(json)) numbers.push_back(number_from(one));
  return numbers;
}

bool truth_from(const Json& json) {
  if (!json.is_boolean()) wrong("expected true or false", json);
  return json.get<bool>();
}

Eigen::MatrixXd matrix_from(const Json& json) {
  const auto rows = whole_from<Eigen::Index>(json, "rows");
  const auto columns = whole_from<Eigen::Index>(json, "columns");
  const Json& values = list_from(json.at("values"));
  const auto count = static_cast<Eigen::Index>(values.size());
  // Divided, not multiplied: a product may overflow.
  if (rows < 0 || columns < 0 ||
      (columns == 0 || rows == 0 ? count != 0 : count % rows != 0 || count / rows != columns)) {
    wrong("a matrix whose size does not fit its values", json);
  }
  Eigen::MatrixXd m(rows, columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < columns; ++j)
      m(i, j) = number_from(values[static_cast<std::size_t>(i * columns + j)]);
  }
  return m;
}

Eigen::VectorXd vector_from(const Json& json) {
  const Eigen::MatrixXd m = matrix_from(json);
  if (m.cols() != 1) wrong("a vector that is not one column", json);
  return m;
}

Vector3 vector3_from(const Json& json) {
  const Eigen::VectorXd v = vector_from(json);
  if (v.size() != 3) wrong("a vector that is not 3 x 1", json);
  return v;
}

Pose pose_from(const Json& json) {
  const Eigen::MatrixXd m = matrix_from(json);
  if (m.rows() != 3 || m.cols() != 4) wrong("a pose that is not 3 x 4", json);
  Pose X = Pose::Identity();
  X.matrix().topRows<3>() = m;
  return X;
}

}  // namespace trammel::model_file
