// SPDX-License-Identifier: Apache-2.0
#include <muParser.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cctype>
#include <memory>
#include <string>
#include <vector>

#include "dynid/base/error.hpp"
#include "dynid/retrieval/constraint.hpp"

namespace dynid {

namespace {

/// One parser a thread: muParser evaluates on variables bound by address.
class Expression {
 public:
  Expression(const std::string& text, int links)
      : parsers_([text, links] { return std::make_unique<Bound>(text, links); }) {}

  double operator()(const Eigen::VectorXd& p) const {
    Bound& bound = *parsers_.local();
    bound.values = p;
    return bound.parser.Eval();
  }

  /// Indices of the parameters read. Throws mu::ParserError where the text does not parse.
  std::vector<int> used() const {
    Bound& bound = *parsers_.local();
    std::vector<int> indices;
    for (const auto& variable : bound.parser.GetUsedVar())
      indices.push_back(static_cast<int>(variable.second - bound.values.data()));
    std::sort(indices.begin(), indices.end());
    bound.parser.Eval();  // some faults show only here
    return indices;
  }

 private:
  struct Bound {
    Bound(const std::string& text, int links) : values(Eigen::VectorXd::Ones(10 * links)) {
      for (int i = 0; i < 10 * links; ++i) parser.DefineVar(variable_name(i), &values[i]);
      parser.SetExpr(text);
    }
    Eigen::VectorXd values;
    mu::Parser parser;
  };
  mutable tbb::enumerable_thread_specific<std::unique_ptr<Bound>> parsers_;
};

// The pieces of `c ? a : b` are smooth where the whole is not, so the optimiser is told of them. What follows
// only cuts the text at its choices, brackets and comparisons; muParser reads the pieces.

std::string stripped(std::string text) {
  for (;;) {
    const auto first = text.find_first_not_of(" \t\n");
    if (first == std::string::npos) return "";
    text = text.substr(first, text.find_last_not_of(" \t\n") - first + 1);
    if (text.front() != '(') return text;
    int depth = 0;
    for (std::size_t i = 0; i < text.size(); ++i) {
      depth += text[i] == '(' ? 1 : (text[i] == ')' ? -1 : 0);
      if (depth == 0 && i + 1 < text.size()) return text;
    }
    text = text.substr(1, text.size() - 2);
  }
}

/// Position of `token` outside all brackets, the last one where `last`.
std::size_t find_outside(const std::string& text, const std::string& token, bool last = false) {
  int depth = 0;
  std::size_t found = std::string::npos;
  for (std::size_t i = 0; i < text.size(); ++i) {
    depth += text[i] == '(' ? 1 : (text[i] == ')' ? -1 : 0);
    if (depth == 0 && text.compare(i, token.size(), token) == 0) {
      found = i;
      if (!last) break;
    }
  }
  return found;
}

/// Sets of differences that are >= 0, any one set of which makes `condition` (or its opposite) true. False
/// where the condition is of another form.
bool guards_of(const std::string& condition, bool opposite, std::vector<std::vector<std::string>>& sets) {
  const std::string text = stripped(condition);
  for (const std::string& token : {std::string("||"), std::string("&&")}) {
    const std::size_t at = find_outside(text, token);
    if (at == std::string::npos) continue;
    std::vector<std::vector<std::string>> left, right;
    if (!guards_of(text.substr(0, at), opposite, left) || !guards_of(text.substr(at + 2), opposite, right))
      return false;
    if ((token == "||") != opposite) {
      sets = left;
      sets.insert(sets.end(), right.begin(), right.end());
    } else {
      for (const auto& one : left) {
        for (const auto& other : right) {
          sets.push_back(one);
          sets.back().insert(sets.back().end(), other.begin(), other.end());
        }
      }
    }
    return true;
  }
  const std::size_t at = text.find_first_of("<>");
  if (at == std::string::npos || text.find_first_of("<>=!&|", at + 2) != std::string::npos) return false;
  if (at > 0 && text[at - 1] == '=') return false;
  const std::size_t after = at + (at + 1 < text.size() && text[at + 1] == '=' ? 2 : 1);
  std::string greater = "(" + text.substr(0, at) + ")", less = "(" + text.substr(after) + ")";
  if (find_outside(text, text.substr(at, 1)) != at) return false;
  if ((text[at] == '<') != opposite) std::swap(greater, less);
  sets = {{greater + " - " + less}};
  return true;
}

struct Piece {
  std::vector<std::string> guards;
  std::string value;
};

constexpr std::size_t most_pieces = 64;

/// Cuts `text` at its choices. False where a condition is of a form that guards_of() does not know.
bool cut(const std::string& text, std::vector<Piece>& pieces) {
  const std::size_t question = text.find('?');
  if (question == std::string::npos) {
    pieces = {{{}, text}};
    return true;
  }
  // A choice binds weakest: it reaches from the bracket or comma before it to the one after it.
  std::size_t begin = question;
  for (int depth = 0; begin > 0; --begin) {
    const char c = text[begin - 1];
    if (depth == 0 && (c == '(' || c == ',')) break;
    depth += c == ')' ? 1 : (c == '(' ? -1 : 0);
  }
  std::size_t colon = std::string::npos, end = question + 1;
  for (int depth = 0, nested = 0; end < text.size(); ++end) {
    const char c = text[end];
    if (depth == 0 && (c == ')' || c == ',')) break;
    depth += c == '(' ? 1 : (c == ')' ? -1 : 0);
    if (depth != 0) continue;
    if (c == '?') ++nested;
    if (c == ':' && nested-- == 0) colon = end;
  }
  if (colon == std::string::npos) return false;
  const std::string before = text.substr(0, begin), after = text.substr(end);
  const std::string condition = text.substr(begin, question - begin);
  for (const bool opposite : {false, true}) {
    std::vector<std::vector<std::string>> sets;
    if (!guards_of(condition, opposite, sets)) return false;
    const std::string chosen =
        opposite ? text.substr(colon + 1, end - colon - 1) : text.substr(question + 1, colon - question - 1);
    std::vector<Piece> rest;
    if (!cut(before + "(" + chosen + ")" + after, rest)) return false;
    for (const auto& set : sets) {
      for (Piece piece : rest) {
        piece.guards.insert(piece.guards.end(), set.begin(), set.end());
        pieces.push_back(std::move(piece));
      }
    }
    if (pieces.size() > most_pieces) return false;
  }
  return true;
}

Inequality inequality(const std::string& text, int links) {
  const auto expression = std::make_shared<Expression>(text, links);
  Inequality h;
  h.variables = expression->used();
  h.value = [expression](const Eigen::VectorXd& p) { return (*expression)(p); };
  if (h.variables.empty()) h.variables = {0};  // a constant
  return h;
}

}  // namespace

Constraint make_expression(const std::string& name, const std::string& expression, int links) {
  const std::string where = "constraint '" + name + "': expression '" + expression + "': ";
  try {
    Constraint whole = make_constraint(name, inequality(expression, links));
    std::vector<Piece> pieces;
    if (expression.find('?') == std::string::npos || !cut(expression, pieces)) return whole;
    Constraint constraint{name, {}, {}, true};
    for (const Piece& piece : pieces) {
      Alternative alternative;
      for (const std::string& guard : piece.guards) alternative.guards.push_back(inequality(guard, links));
      alternative.required = {inequality(piece.value, links)};
      constraint.alternatives.push_back(std::move(alternative));
    }
    constraint.exact = whole.alternatives.front().required.front().value;
    return constraint;
  } catch (const mu::ParserError& error) {
    if (error.GetCode() == mu::ecUNASSIGNABLE_TOKEN)
      throw Error(where + "unknown name '" + error.GetToken() + "': the parameters of " +
                  std::to_string(links) +
                  " links are m1, c1x, c1y, c1z, I1xx, I1xy, I1xz, I1yy, I1yz, I1zz, ..., I" +
                  std::to_string(links) + "zz");
    std::string text = error.GetMsg();
    std::replace(text.begin(), text.end(), '\n', ' ');
    throw Error(where + text);
  }
}

}  // namespace dynid
