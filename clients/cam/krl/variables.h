#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

#include "clients/cam/krl/lines.h"
#include "clients/cam/program.h"
#include "server/base/letters.h"

/// The values of the names of a KRL program.
namespace trammel::cam::krl {

/// A value, or one clause with the reason why the program decides it at run time.
template <typename T>
using Told = tl::expected<T, std::string>;
[[nodiscard]] inline tl::unexpected<std::string> because(std::string why) {
  return tl::make_unexpected(std::move(why));
}

constexpr std::array<const char*, 6> kPose = {"X", "Y", "Z", "A", "B", "C"};
constexpr std::array<const char*, 6> kAxes = {"A1", "A2", "A3", "A4", "A5", "A6"};

/// A value that a line gives to a name.
struct Assigned {
  std::size_t file = 0, line = 0;
  std::vector<Value> operands;
};

struct Variable {
  std::vector<Assigned> values;
  std::string changed;  ///< why its value is decided at run time
};

[[nodiscard]] std::string stem_of(const std::string& name);
/// `XP[3].X` -> `XP[3]`
[[nodiscard]] std::string root_of(const std::string& name);
class Variables {
 public:
  /// The variables of files and their lines, which may still grow.
  Variables(const std::vector<SourceFile>& files, const std::vector<std::vector<Line>>& lines);

  /// A declaration or assignment: behind `DECL` and a type, or bare.
  void note_value(std::size_t f, std::size_t k);
  /// Records `(p:IN,q:OUT)`, from a token on: within the routine these names hide those of data
  /// lists.
  void note_parameters(std::size_t f, std::size_t k, std::size_t at);
  /// A name that stands alone between brackets or commas of a call, which may set it.
  void note_handed_over(std::size_t f, std::size_t k, std::size_t at, const std::string& to);
  /// Joins the variables that a file sets and does not declare. They belong to another file or to
  /// the controller.
  void join_globals();
  [[nodiscard]] std::string place(std::size_t f, std::size_t k) const;
  /// A name as a line spells it.
  [[nodiscard]] std::string spelled(const std::string& name, std::size_t f, std::size_t k) const;
  /// The variable of a file's own data list, else of any.
  [[nodiscard]] const Variable* find(const std::string& name, std::size_t f) const;
  /// True if a file gives it a value, constant or not.
  [[nodiscard]] bool is_set(const std::string& name, std::size_t f) const;
  /// The only value of a name.
  [[nodiscard]] Told<const Assigned*> value_of(const std::string& name, std::size_t f) const;
  [[nodiscard]] Told<Pose> frame_of(const std::vector<Value>& operands, std::size_t f,
                                    int depth = 0) const;
  /// The value of `$ROBROOT`: the robot's base, seen from `$WORLD`.
  void set_robroot(const Pose& X_WB) { X_WB_ = X_WB; }
  [[nodiscard]] const Pose& robroot() const { return X_WB_; }
  [[nodiscard]] static Told<std::vector<double>> numbers_of(
      const Value& value, const std::array<const char*, 6>& fields);
  /// By file and name.
  [[nodiscard]] const std::map<std::pair<std::string, std::string>, Variable>& all() const {
    return variables_;
  }

 private:
  void note_value(std::size_t f, std::size_t k, std::size_t at);
  void merge(const Variable& from, const std::string& root, Variable& into) const;
  /// The change of any element of its array; null: there is none.
  [[nodiscard]] const Variable* any_changed(const std::string& name, std::size_t f) const;
  [[nodiscard]] std::string set_at(const std::string& name, std::size_t f, std::size_t k) const;
  [[nodiscard]] Told<Pose> frame_of(const Value& value, std::size_t f, int depth) const;

  const std::vector<SourceFile>& files_;
  const std::vector<std::vector<Line>>& lines_;
  std::map<std::pair<std::string, std::string>, Variable> variables_;
  std::map<std::string, std::set<std::string>> declared_;  ///< the files that declare each word
  Pose X_WB_ = Pose::Identity();
};

}  // namespace trammel::cam::krl
