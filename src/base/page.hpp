// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace dynid {

/// The HTML page that the template `name` (a file of src/app/page/, without its suffix: Mustache, which can
/// use the others as partials, `part:name`, and as they stand, `text:name`) makes of `view`: an object whose
/// strings are text, escaped where the template does not say otherwise; numbers are written as JSON writes
/// them. An empty text, null and an empty list are false. Throws Error naming the template that is missing or
/// wrong. Allocates.
std::string rendered_page(const std::string& name, const nlohmann::json& view);

/// Whether there is a template of this name: the plotter (`uplot_script`, `uplot_style`) may be missing.
bool has_page_template(const std::string& name);

namespace detail {

/// Text of every template, by name.
const std::map<std::string, std::string>& page_templates();

}  // namespace detail
}  // namespace dynid
