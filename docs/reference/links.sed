# Links to a heading become links to its page: Doxygen names headings otherwise.
s/\]\(([^)#:]+)#[^)]*\)/](\1)/g
s/\[([^]]*)\]\(#[^)]*\)/\1/g
