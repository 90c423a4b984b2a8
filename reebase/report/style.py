"""How the report looks: one sheet, light and dark after the reader's own setting, wide tables scroll by themselves."""

from __future__ import annotations

__all__ = ["STYLE"]

STYLE = """
:root{color-scheme:light dark;--ground:#f4f6f8;--card:#fff;--ink:#1b2733;--soft:#55616c;--line:#dde3e8;
--accent:#0067a8;--good:#00714f;--bad:#b3400e;--shade:0,103,168}
@media(prefers-color-scheme:dark){:root{--ground:#0e1318;--card:#151b22;--ink:#e6ebf0;--soft:#9aa7b3;--line:#2b343e;
--accent:#6cbcf0;--good:#3ddba5;--bad:#ff9d5c;--shade:86,180,233}}
*{box-sizing:border-box}
html{scroll-behavior:smooth}
@media(prefers-reduced-motion:reduce){html{scroll-behavior:auto}}
body{margin:0;background:var(--ground);color:var(--ink);font:16px/1.5 system-ui,"Segoe UI",Roboto,sans-serif}
header,main,footer{max-width:72rem;margin:0 auto;padding:0 1rem}
header{padding-top:1.6rem}
h1{font-size:1.7rem;line-height:1.2;margin:0 0 .3rem;overflow-wrap:anywhere}
h2{font-size:1.2rem;margin:0 0 .5rem}
h3{font-size:1rem;margin:1.4rem 0 .4rem}
p{max-width:46rem;margin:.4rem 0 .9rem}
.soft,caption,small,footer{color:var(--soft)}
a{color:var(--accent)}
a:focus-visible,summary:focus-visible,.wide:focus-visible{outline:2px solid var(--accent);outline-offset:2px}
nav ul{display:flex;flex-wrap:wrap;gap:.2rem 1.1rem;list-style:none;padding:0;margin:.8rem 0 1.2rem}
nav a{display:inline-block;padding:.35rem 0}
section{background:var(--card);border:1px solid var(--line);border-radius:12px;padding:1.1rem 1.2rem;margin:0 0 1rem}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.15rem 1rem;margin:.4rem 0}
dt{color:var(--soft)}
dd{margin:0;overflow-wrap:anywhere}
.wide+.wide{margin-top:1.2rem}
.wide{overflow-x:auto;margin-left:-.4rem;margin-right:-.4rem;padding:0 .4rem}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.92rem}
caption{text-align:left;padding:.2rem 0 .5rem;font-size:.9rem}
th,td{padding:.38rem .7rem;border-bottom:1px solid var(--line);text-align:right;vertical-align:top;white-space:nowrap}
th:first-child,td:first-child{text-align:left;position:sticky;left:0;background:var(--card);z-index:1}
thead th{font-weight:600;color:var(--soft);vertical-align:bottom}
tbody th{font-weight:600}
td small{display:block;font-size:.74rem;line-height:1.2}
td strong{color:var(--accent)}
td.shade{background:rgba(var(--shade),calc(var(--v)*.38))}
td.text,th.text{text-align:left;white-space:normal;min-width:20rem}
figure{margin:0}
figure img{max-width:100%;height:auto;display:block}
figure.square img{max-width:min(100%,40rem)}
details{border-top:1px solid var(--line);padding:.3rem 0}
details:first-of-type{border-top:0}
summary{cursor:pointer;padding:.45rem 0;font-weight:600}
summary small{font-weight:400;margin-left:.5rem}
.lists{display:grid;gap:.9rem;margin:.3rem 0 1rem}
.list{display:grid;grid-template-columns:7.2rem 1fr;gap:.6rem;align-items:start}
.hits{display:grid;grid-template-columns:repeat(10,minmax(0,1fr));gap:.35rem;list-style:none;padding:0;margin:0}
.shape{font-size:.72rem;line-height:1.25;min-width:0}
.shape svg{display:block;width:100%;aspect-ratio:1;border-radius:8px;
border:2px solid var(--line)}
.shape .none{display:block;aspect-ratio:2;border-radius:8px;border:2px dashed var(--line)}
.shape.yes svg,.shape.yes .none{border-color:var(--good)}
.shape.no svg,.shape.no .none{border-color:var(--bad)}
.shape b,.shape span{display:block;overflow:hidden;text-overflow:ellipsis;white-space:nowrap}
.shape.yes b{color:var(--good)}
.shape.no b{color:var(--bad)}
.pool{position:absolute;width:0;height:0;overflow:hidden}
footer{padding-bottom:2rem;font-size:.88rem}
@media(max-width:46rem){
section{padding:.9rem .8rem;border-radius:10px}
dl{grid-template-columns:1fr}dd{margin-bottom:.4rem}
.list{grid-template-columns:1fr}
.list>.shape{display:grid;grid-template-columns:4.5rem 1fr;gap:0 .6rem;grid-auto-rows:min-content}
.list>.shape svg,.list>.shape .none{grid-row:1/4}
.hits{grid-template-columns:repeat(5,minmax(0,1fr))}
th,td{padding:.34rem .5rem}
}
@media print{body{background:#fff}section{break-inside:avoid-page}.hits,.shape svg{print-color-adjust:exact}}
"""
