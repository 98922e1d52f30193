#include "clients/cam/urscript/tools.h"

#include <fmt/format.h>

#include <utility>

namespace trammel::cam::urscript {

namespace {

/// `[0, 0, 0.1]` from a token on; empty: it is not constant.
std::optional<Vector3> centre_at(const Tokens& tokens, std::size_t at) {
  if (!tokens[at].is("[")) return std::nullopt;
  const std::size_t end = tokens.find("]", at);
  const std::vector<double> centre = values_in(tokens.part(at, end));
  for (++at; at < end; ++at) {
    if (!tokens[at].is_number() && !tokens[at].is(",")) return std::nullopt;
  }
  if (centre.size() != 3) return std::nullopt;
  return Vector3(centre[0], centre[1], centre[2]);
}

}  // namespace

std::size_t Loads::add(Load load) {
  for (std::size_t k = 1; k < all_.size(); ++k) {
    const Load& known = all_[k];
    const bool same =
        known.load.has_value() == load.load.has_value() &&
        (!load.load || (known.load->mass == load.load->mass && known.load->p_F == load.load->p_F &&
                        known.load->has_centre == load.load->has_centre));
    if (same && known.why_not == load.why_not) return k;
  }
  all_.push_back(std::move(load));
  return all_.size() - 1;
}

std::size_t Loads::set(const Tokens& tokens, std::size_t at, std::size_t before,
                       const std::string& file) {
  const std::string where = fmt::format("{} ({} line {})", tokens[at].text, file, tokens[at].line);
  Load load{where, std::nullopt, ""};
  StatedLoad stated;
  stated.has_centre = false;
  const std::optional<StatedLoad> known = all_[before].load;
  std::size_t next = at + 2;
  bool constant = true;
  if (tokens[at].is("set_payload_cog")) {
    if (!known) return before;
    stated = *known;
  } else {
    if (known && tokens[at].is("set_payload_mass")) stated = *known;
    constant = tokens[next].is_number() && (tokens[next + 1].is(",") || tokens[next + 1].is(")"));
    if (constant) stated.mass = value_in(tokens[next]);
    next += 2;
  }
  if (constant && !tokens[at].is("set_payload_mass") && next < tokens.size() &&
      !tokens[next - 1].is(")")) {
    const auto centre = centre_at(tokens, next);
    constant = centre.has_value();
    if (centre) stated.p_F = *centre;
    stated.has_centre = true;
  }
  if (constant)
    load.load = stated;
  else
    load.why_not = where + " is not constant";
  return add(std::move(load));
}

std::size_t Tools::not_set() {
  ProgramTool tool;
  tool.name = "tcp";
  take_row("TCP", options_, tool);
  program_.tools.push_back(std::move(tool));
  return program_.tools.size() - 1;
}

std::size_t Tools::set(const Told<Pose>& X_FT, const std::string& file, int line) {
  ProgramTool tool;
  tool.name = "tcp";
  tool.file = file;
  tool.line = line;
  tool.rotation_rounding = 2e-4;
  if (X_FT)
    tool.X_FT = *X_FT;
  else
    tool.why_not = fmt::format("set_tcp (line {}): {}", line, X_FT.error());
  return add(std::move(tool));
}

std::size_t Tools::unknown(const std::string& why) {
  ProgramTool tool;
  tool.name = "tcp";
  tool.why_not = why;
  return add(std::move(tool));
}

std::size_t Tools::carrying(std::size_t tool, std::size_t load) {
  if (load == 0) return tool;
  const auto [entry, is_new] = carrying_.try_emplace({tool, load}, 0);
  if (!is_new) return entry->second;
  ProgramTool made = program_.tools[tool];
  made.carries = loads_[load].name;
  made.load = loads_[load].load;
  if (made.why_not.empty()) made.why_not = loads_[load].why_not;
  return entry->second = add(std::move(made));
}

std::size_t Tools::add(ProgramTool tool) {
  for (std::size_t k = 0; k < program_.tools.size(); ++k) {
    const ProgramTool& known = program_.tools[k];
    const bool same_pose = known.X_FT && tool.X_FT && known.X_FT->isApprox(*tool.X_FT, 1e-12);
    const bool both_unknown =
        !known.X_FT && !tool.X_FT && known.why_not == tool.why_not && !tool.why_not.empty();
    if ((same_pose || both_unknown) && known.carries == tool.carries &&
        known.why_not == tool.why_not)
      return k;
  }
  program_.tools.push_back(std::move(tool));
  return program_.tools.size() - 1;
}

}  // namespace trammel::cam::urscript
