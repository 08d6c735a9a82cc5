# Doxygen reads this tree's comments as they stand: "//" before a declaration documents it and the
# declarations that follow without a blank line or a comment of their own; "//" after a member, with
# the lines that continue it in the same column, documents that member; a comment with a blank line
# after it documents the file.

function indent(line) { match(line, /^ */); return RLENGTH }
function is_comment(line) { return line ~ /^ *\/\// }
function uncommented(line) { sub(/^ *\/\/+<? ?/, "", line); return line }

# Where a trailing comment starts (0: none). No string in a header's declarations holds "//".
function trailing(line,   at) {
  at = index(line, "//")
  if (at == 0 || line ~ /^ *[}#]/ || is_comment(line) || substr(line, 1, at) ~ /"[^"]*$/) return 0
  return at
}

# The line with its trailing comment as Doxygen wants it.
function member(line, at) { return substr(line, 1, at - 1) "///< " uncommented(substr(line, at)) }

# One past the last line of the declarations that the comment above line `from` speaks for.
function group_end(from,   i, depth, line) {
  depth = 0
  for (i = from; i <= count; ++i) {
    line = lines[i]
    if (depth == 0 && (line ~ /^ *$/ || is_comment(line) || line ~ /^ *}/ ||
                       line ~ /^ *(public|private|protected):/)) return i
    sub(/\/\/.*/, "", line)
    depth += gsub(/{/, "{", line) - gsub(/}/, "}", line)
  }
  return i
}

{ lines[++count] = $0 }

END {
  file_documented = 0
  for (i = 1; i <= count; ++i) {
    if (i in closing) print closing[i]
    line = lines[i]
    if (is_comment(line)) {
      for (end = i; end <= count && is_comment(lines[end]); ++end) {}
      alone = end > count || lines[end] ~ /^ *$/
      pad = substr(line, 1, indent(line))
      for (first = end; lines[first] ~ /^ *template/; ++first) {}
      scope = lines[first] ~ /^ *(struct|class|enum|namespace|friend)/
      if (alone && !file_documented && indent(line) == 0) {
        print "/// @file"
        file_documented = 1
      } else if (!alone && !scope) {
        last = group_end(end)
        if (last > end + 1) {
          before = (last in closing) ? "\n" closing[last] : ""
          closing[last] = pad "///@}" before
          print pad "///@{"
        }
      }
      for (; i < end; ++i) {
        print pad (alone && !(file_documented == 1) ? "// " : "/// ") uncommented(lines[i])
      }
      if (alone && file_documented == 1) file_documented = 2
      --i
      continue
    }
    at = trailing(line)
    if (at == 0) {
      print line
      continue
    }
    print member(line, at)
    while (i < count && is_comment(lines[i + 1]) && indent(lines[i + 1]) == at - 1) {
      ++i
      print substr(lines[i], 1, at - 1) "///< " uncommented(lines[i])
    }
  }
}
