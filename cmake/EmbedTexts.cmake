# cmake -DSOURCES=<file;...> -DOUTPUT=<file.c> -DHEADER=<header> -DTYPE=<type> -DTABLE=<name> -P EmbedTexts.cmake
# Writes a C file with the table `const TYPE TABLE[]` of each file's name and text, as HEADER declares it.
# Texts become arrays of bytes: a string literal would meet the limits on its length, and CMake's own
# treatment of semicolons, brackets and backslashes.
set(arrays "")
set(rows "")
set(index 0)
foreach(path IN LISTS SOURCES)
  get_filename_component(name "${path}" NAME)
  file(READ "${path}" bytes HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
  string(REPLACE "0x0a," "0x0a,\n    " bytes "${bytes}") # a line of C for a line of text
  string(APPEND arrays "static const unsigned char text_${index}[] = {\n    ${bytes}0x00};\n\n")
  string(APPEND rows "    {\"${name}\", (const char *)text_${index}},\n")
  math(EXPR index "${index} + 1")
endforeach()
file(WRITE "${OUTPUT}" "/* Made by EmbedTexts.cmake. */
#include \"${HEADER}\"

${arrays}const ${TYPE} ${TABLE}[] = {
${rows}    {NULL, NULL},
};
")
