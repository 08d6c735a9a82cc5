# Files as C++ strings, so that the program needs none of them beside it:
#   unfurl_embed(out.cc HEADER report/assets.h NAMESPACE unfurl::report kName path kName path ...)
# Licence comments that name a URL and references to source maps are left out: a page must not
# hold an address that a browser could follow. The licences' texts stand in report/page.cc.

if(CMAKE_SCRIPT_MODE_FILE)
  set(text "// Made by cmake/UnfurlEmbed.cmake; not to be edited.\n#include \"${HEADER}\"\n\n")
  string(APPEND text "namespace ${NAMESPACE} {\n")
  string(REPLACE "|" ";" ENTRIES "${ENTRIES}")
  while(ENTRIES)
    list(POP_FRONT ENTRIES name path)
    file(READ "${path}" content)
    string(REGEX REPLACE "/\\*[*!]?[ \t\r\n*]*@license[^*]*(\\*+[^*/][^*]*)*\\*+/\n?" "" content "${content}")
    string(REGEX REPLACE "//# sourceMappingURL=[^\n]*" "" content "${content}")
    string(REGEX REPLACE "/\\*# sourceMappingURL=[^\n]*" "" content "${content}")
    # Of addresses only the names stay by which elements are of HTML or SVG: nobody follows them.
    string(REPLACE "http://www.w3.org/" "UNFURL_NAMES_OF" content "${content}")
    string(REGEX REPLACE "https?://[A-Za-z0-9._~/#-]*" "" content "${content}")
    string(REPLACE "UNFURL_NAMES_OF" "http://www.w3.org/" content "${content}")
    string(FIND "${content}" ")unfurl\"" clash)
    if(NOT clash EQUAL -1)
      message(FATAL_ERROR "${path} holds the delimiter of the string it is put into")
    endif()
    string(APPEND text "const std::string_view ${name} = R\"unfurl(${content})unfurl\";\n")
  endwhile()
  string(APPEND text "}  // namespace ${NAMESPACE}\n")
  file(WRITE "${OUTPUT}" "${text}")
  return()
endif()

set(UNFURL_EMBED_SCRIPT ${CMAKE_CURRENT_LIST_FILE})
function(unfurl_embed output)
  cmake_parse_arguments(ARG "" "HEADER;NAMESPACE" "FILES" ${ARGN})
  set(depends ${UNFURL_EMBED_SCRIPT})
  set(rest ${ARG_FILES})
  while(rest)
    list(POP_FRONT rest name path)
    list(APPEND depends ${path})
  endwhile()
  string(REPLACE ";" "|" entries "${ARG_FILES}")
  add_custom_command(OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DOUTPUT=${output} -DHEADER=${ARG_HEADER}
            -DNAMESPACE=${ARG_NAMESPACE} "-DENTRIES=${entries}" -P ${UNFURL_EMBED_SCRIPT}
    DEPENDS ${depends} COMMENT "Embedding files in the program" VERBATIM)
  set_source_files_properties(${output} PROPERTIES COMPILE_OPTIONS -Wno-overlength-strings)
endfunction()
