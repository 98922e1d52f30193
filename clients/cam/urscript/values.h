#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "clients/cam/keep.h"
#include "clients/cam/program.h"

/// The values of the expressions of a script, as far as they are constant.
namespace trammel::cam::urscript {

template <typename T>
using Told = tl::expected<T, std::string>;
[[nodiscard]] inline tl::unexpected<std::string> because(std::string why) {
  return tl::make_unexpected(std::move(why));
}

/// Six numbers in brackets, one number, a name, or a function of such.
struct Value {
  enum class Kind { kPose, kJoints, kNumber, kName, kCall, kOther };
  Kind kind = Kind::kOther;
  std::size_t begin = 0, end = 0;
  int line = 1;
  std::string name;
  std::string label = {};  ///< of an argument: `qnear=q`
  std::vector<Token> numbers;
  std::vector<Value> arguments;
};

struct Variable {
  Value value;
  std::string changed;
  /// The constants assigned to it in sequence, each valid until the next; empty: `value` is the
  /// only one.
  std::vector<Value> in_order = {};
  bool is_global = false, is_local = false;  ///< as declared by any of its assignments
  std::set<std::size_t> functions = {};      ///< functions that set it, by the token of their `def`
  std::string set_again = {};                ///< the place of a second assignment
};

/// Which of its constants a variable that is set in order has; kUndecided: another one on each way.
using Settings = std::map<std::string, std::size_t>;
constexpr std::size_t kUndecided = static_cast<std::size_t>(-1);

/// An assignment of a constant to a variable that has several.
struct Assignment {
  std::string name;
  std::size_t number = 0;
};

/// `pose_trans`, `pose_inv`, `pose_add`, `interpolate_pose`
[[nodiscard]] bool is_function_of_poses(const std::string& name);
/// `def`, `thread`
[[nodiscard]] bool defines(const Token& token);
/// `def`, `if`: it has an `end`.
[[nodiscard]] bool opens(const Token& token);
/// The numbers of a value that has six in brackets.
[[nodiscard]] std::vector<double> numbers_in(const Value& value);

class Values {
 public:
  /// Reads the tokens of a script, named `file` in reasons, and finds the values of its variables.
  Values(const Tokens& tokens, std::string file);

  /// The value from a token on; `at` is set behind it.
  [[nodiscard]] Value value_at(std::size_t& at, int depth = 0) const;
  [[nodiscard]] bool ends_here(std::size_t at, int line) const;
  /// `stored`: the value was made earlier, when a variable may have had another value.
  [[nodiscard]] Told<Value> resolved(const Value& value, bool stored = false) const;
  [[nodiscard]] Told<Pose> pose_of_value(const Value& value, int depth, bool stored = false) const;
  /// Sets the settings for the expressions that are evaluated next; nullptr: not known.
  void assume(const Settings* settings) { now_ = settings; }
  [[nodiscard]] const std::map<std::string, Variable>& variables() const { return variables_; }
  /// Assignments to variables that are set in order, by the token behind them.
  [[nodiscard]] const std::multimap<std::size_t, Assignment>& assignments() const {
    return assignments_;
  }
  [[nodiscard]] bool is_set_in_order(const std::string& name) const {
    return variables_.at(name).in_order.size() > 1;
  }

 private:
  void note_block(std::size_t at);
  [[nodiscard]] std::size_t function_here() const;
  void read_list(std::size_t& at, Value& value) const;
  void read_call(std::size_t& at, Value& value, int depth) const;
  [[nodiscard]] Told<Pose> between(const Value& call, int depth, bool stored) const;
  void note_assignment(std::size_t at);
  void note_parameters(std::size_t at);
  static void find_order(Variable& variable);

  const Tokens& tokens_;
  std::string file_;
  std::map<std::string, Variable> variables_;
  std::multimap<std::size_t, Assignment> assignments_;
  std::vector<std::size_t> open_;  ///< tokens that open blocks, while assignments are noted
  const Settings* now_ = nullptr;
};

}  // namespace trammel::cam::urscript
