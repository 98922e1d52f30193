/PROG  KONTUR
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "panel";
PROG_SIZE	= 612;
CREATE		= DATE 26-11-22  TIME 10:31:04;
LINE_COUNT	= 4;
DEFAULT_GROUP	= 1,*,*,*,*;
/APPL
/MN
   1:  UFRAME_NUM=1 ;
   2:  UTOOL_NUM=1 ;
   3:L P[1] 60mm/sec CNT100     ;
   4:L P[2] 60mm/sec CNT100     ;
   5:L P[3] 60mm/sec CNT100     ;
   6:L P[4] 60mm/sec CNT100     ;
   7:L P[5] 60mm/sec CNT100     ;
   8:L P[6] 60mm/sec CNT100     ;
   9:L P[7] 60mm/sec CNT100     ;
  10:L P[8] 60mm/sec CNT100     ;
  11:L P[9] 60mm/sec CNT100     ;
  12:L P[10] 60mm/sec CNT100     ;
  13:L P[11] 60mm/sec CNT100     ;
  14:L P[12] 60mm/sec CNT100     ;
  15:L P[13] 60mm/sec CNT100     ;
  16:L P[14] 60mm/sec CNT100     ;
  17:L P[15] 60mm/sec CNT100     ;
  18:L P[16] 60mm/sec CNT100     ;
  19:L P[17] 60mm/sec CNT100     ;
  20:L P[18] 60mm/sec CNT100     ;
  21:L P[19] 60mm/sec CNT100     ;
  22:L P[20] 60mm/sec CNT100     ;
  23:L P[21] 60mm/sec CNT100     ;
  24:L P[22] 60mm/sec CNT100     ;
  25:L P[23] 60mm/sec CNT100     ;
  26:L P[24] 60mm/sec CNT100     ;
  27:L P[25] 60mm/sec CNT100     ;
  28:L P[26] 60mm/sec CNT100     ;
  29:L P[27] 60mm/sec CNT100     ;
  30:L P[28] 60mm/sec CNT100     ;
  31:L P[29] 60mm/sec CNT100     ;
  32:L P[30] 60mm/sec CNT100     ;
  33:L P[31] 60mm/sec CNT100     ;
  34:L P[32] 60mm/sec CNT100     ;
  35:L P[33] 60mm/sec CNT100     ;
  36:L P[34] 60mm/sec CNT100     ;
  37:L P[35] 60mm/sec CNT100     ;
  38:L P[36] 60mm/sec CNT100     ;
  39:L P[37] 60mm/sec CNT100     ;
  40:L P[38] 60mm/sec CNT100     ;
  41:L P[39] 60mm/sec CNT100     ;
  42:L P[40] 60mm/sec CNT100     ;
  43:L P[41] 60mm/sec CNT100     ;
  44:L P[42] 60mm/sec CNT100     ;
  45:L P[43] 60mm/sec CNT100     ;
  46:L P[44] 60mm/sec CNT100     ;
  47:L P[45] 60mm/sec CNT100     ;
  48:L P[46] 60mm/sec CNT100     ;
  49:L P[47] 60mm/sec CNT100     ;
  50:L P[48] 60mm/sec CNT100     ;
  51:L P[49] 60mm/sec CNT100     ;
  52:L P[50] 60mm/sec CNT100     ;
  53:L P[51] 60mm/sec CNT100     ;
  54:L P[52] 60mm/sec CNT100     ;
  55:L P[53] 60mm/sec CNT100     ;
  56:L P[54] 60mm/sec CNT100     ;
  57:L P[55] 60mm/sec CNT100     ;
  58:L P[56] 60mm/sec CNT100     ;
  59:L P[57] 60mm/sec CNT100     ;
  60:L P[58] 60mm/sec CNT100     ;
  61:L P[59] 60mm/sec CNT100     ;
  62:L P[60] 60mm/sec CNT100     ;
  63:L P[61] 60mm/sec CNT100     ;
  64:L P[62] 60mm/sec CNT100     ;
  65:L P[63] 60mm/sec CNT100     ;
  66:L P[64] 60mm/sec CNT100     ;
  67:L P[65] 60mm/sec CNT100     ;
  68:L P[66] 60mm/sec CNT100     ;
  69:L P[67] 60mm/sec CNT100     ;
  70:L P[68] 60mm/sec CNT100     ;
  71:L P[69] 60mm/sec CNT100     ;
  72:L P[70] 60mm/sec CNT100     ;
  73:L P[71] 60mm/sec CNT100     ;
  74:L P[72] 60mm/sec CNT100     ;
  75:L P[73] 60mm/sec CNT100     ;
  76:L P[74] 60mm/sec CNT100     ;
  77:L P[75] 60mm/sec CNT100     ;
  78:L P[76] 60mm/sec CNT100     ;
  79:L P[77] 60mm/sec CNT100     ;
  80:L P[78] 60mm/sec CNT100     ;
  81:L P[79] 60mm/sec CNT100     ;
  82:L P[80] 60mm/sec CNT100     ;
  83:L P[81] 60mm/sec CNT100     ;
  84:L P[82] 60mm/sec CNT100     ;
  85:L P[83] 60mm/sec CNT100     ;
  86:L P[84] 60mm/sec CNT100     ;
  87:L P[85] 60mm/sec CNT100     ;
  88:L P[86] 60mm/sec CNT100     ;
  89:L P[87] 60mm/sec CNT100     ;
  90:L P[88] 60mm/sec CNT100     ;
  91:L P[89] 60mm/sec CNT100     ;
  92:L P[90] 60mm/sec CNT100     ;
  93:L P[91] 60mm/sec CNT100     ;
  94:L P[92] 60mm/sec CNT100     ;
  95:L P[93] 60mm/sec CNT100     ;
  96:L P[94] 60mm/sec CNT100     ;
  97:L P[95] 60mm/sec CNT100     ;
  98:L P[96] 60mm/sec CNT100     ;
  99:L P[97] 60mm/sec CNT100     ;
 100:L P[98] 60mm/sec CNT100     ;
 101:L P[99] 60mm/sec CNT100     ;
 102:L P[100] 60mm/sec CNT100     ;
 103:L P[101] 60mm/sec CNT100     ;
 104:L P[102] 60mm/sec CNT100     ;
 105:L P[103] 60mm/sec CNT100     ;
 106:L P[104] 60mm/sec CNT100     ;
 107:L P[105] 60mm/sec CNT100     ;
 108:L P[106] 60mm/sec CNT100     ;
 109:L P[107] 60mm/sec CNT100     ;
 110:L P[108] 60mm/sec CNT100     ;
 111:L P[109] 60mm/sec CNT100     ;
 112:L P[110] 60mm/sec CNT100     ;
 113:L P[111] 60mm/sec CNT100     ;
 114:L P[112] 60mm/sec CNT100     ;
 115:L P[113] 60mm/sec CNT100     ;
 116:L P[114] 60mm/sec CNT100     ;
 117:L P[115] 60mm/sec CNT100     ;
 118:L P[116] 60mm/sec CNT100     ;
 119:L P[117] 60mm/sec CNT100     ;
 120:L P[118] 60mm/sec CNT100     ;
 121:L P[119] 60mm/sec CNT100     ;
 122:L P[120] 60mm/sec CNT100     ;
 123:L P[121] 60mm/sec CNT100     ;
 124:L P[122] 60mm/sec CNT100     ;
 125:L P[123] 60mm/sec CNT100     ;
 126:L P[124] 60mm/sec CNT100     ;
 127:L P[125] 60mm/sec CNT100     ;
 128:L P[126] 60mm/sec CNT100     ;
 129:L P[127] 60mm/sec CNT100     ;
 130:L P[128] 60mm/sec CNT100     ;
 131:L P[129] 60mm/sec CNT100     ;
 132:L P[130] 60mm/sec CNT100     ;
 133:L P[131] 60mm/sec CNT100     ;
 134:L P[132] 60mm/sec CNT100     ;
 135:L P[133] 60mm/sec CNT100     ;
 136:L P[134] 60mm/sec CNT100     ;
 137:L P[135] 60mm/sec CNT100     ;
 138:L P[136] 60mm/sec CNT100     ;
 139:L P[137] 60mm/sec CNT100     ;
 140:L P[138] 60mm/sec CNT100     ;
 141:L P[139] 60mm/sec CNT100     ;
 142:L P[140] 60mm/sec CNT100     ;
 143:L P[141] 60mm/sec CNT100     ;
 144:L P[142] 60mm/sec CNT100     ;
 145:L P[143] 60mm/sec CNT100     ;
 146:L P[144] 60mm/sec CNT100     ;
 147:L P[145] 60mm/sec CNT100     ;
 148:L P[146] 60mm/sec CNT100     ;
 149:L P[147] 60mm/sec CNT100     ;
 150:L P[148] 60mm/sec CNT100     ;
 151:L P[149] 60mm/sec CNT100     ;
 152:L P[150] 60mm/sec CNT100     ;
 153:L P[151] 60mm/sec CNT100     ;
 154:L P[152] 60mm/sec CNT100     ;
 155:L P[153] 60mm/sec CNT100     ;
 156:L P[154] 60mm/sec CNT100     ;
 157:L P[155] 60mm/sec CNT100     ;
 158:L P[156] 60mm/sec CNT100     ;
 159:L P[157] 60mm/sec CNT100     ;
 160:L P[158] 60mm/sec CNT100     ;
 161:L P[159] 60mm/sec CNT100     ;
 162:L P[160] 60mm/sec CNT100     ;
 163:L P[161] 60mm/sec CNT100     ;
 164:L P[162] 60mm/sec CNT100     ;
 165:L P[163] 60mm/sec CNT100     ;
 166:L P[164] 60mm/sec CNT100     ;
 167:L P[165] 60mm/sec CNT100     ;
 168:L P[166] 60mm/sec CNT100     ;
 169:L P[167] 60mm/sec CNT100     ;
 170:L P[168] 60mm/sec CNT100     ;
 171:L P[169] 60mm/sec CNT100     ;
 172:L P[170] 60mm/sec CNT100     ;
 173:L P[171] 60mm/sec CNT100     ;
 174:L P[172] 60mm/sec CNT100     ;
 175:L P[173] 60mm/sec CNT100     ;
 176:L P[174] 60mm/sec CNT100     ;
 177:L P[175] 60mm/sec CNT100     ;
 178:L P[176] 60mm/sec CNT100     ;
 179:L P[177] 60mm/sec CNT100     ;
 180:L P[178] 60mm/sec CNT100     ;
 181:L P[179] 60mm/sec CNT100     ;
 182:L P[180] 60mm/sec CNT100     ;
 183:L P[181] 60mm/sec CNT100     ;
 184:L P[182] 60mm/sec CNT100     ;
 185:L P[183] 60mm/sec CNT100     ;
 186:L P[184] 60mm/sec CNT100     ;
 187:L P[185] 60mm/sec CNT100     ;
 188:L P[186] 60mm/sec CNT100     ;
 189:L P[187] 60mm/sec CNT100     ;
 190:L P[188] 60mm/sec CNT100     ;
 191:L P[189] 60mm/sec CNT100     ;
 192:L P[190] 60mm/sec CNT100     ;
 193:L P[191] 60mm/sec CNT100     ;
 194:L P[192] 60mm/sec CNT100     ;
 195:L P[193] 60mm/sec CNT100     ;
 196:L P[194] 60mm/sec CNT100     ;
 197:L P[195] 60mm/sec CNT100     ;
 198:L P[196] 60mm/sec CNT100     ;
 199:L P[197] 60mm/sec CNT100     ;
 200:L P[198] 60mm/sec CNT100     ;
 201:L P[199] 60mm/sec CNT100     ;
 202:L P[200] 60mm/sec CNT100     ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    205.000  mm,	Z =      0.000  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[2]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.963  mm,	Z =      1.499  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[3]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.850  mm,	Z =      2.995  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[4]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.663  mm,	Z =      4.483  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[5]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.402  mm,	Z =      5.960  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[6]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.067  mm,	Z =      7.422  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[7]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    203.660  mm,	Z =      8.866  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[8]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    203.181  mm,	Z =     10.287  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[9]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    202.632  mm,	Z =     11.683  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[10]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    202.013  mm,	Z =     13.049  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[11]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    201.327  mm,	Z =     14.383  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[12]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    200.576  mm,	Z =     15.681  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[13]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    199.760  mm,	Z =     16.939  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[14]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    198.883  mm,	Z =     18.156  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[15]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    197.945  mm,	Z =     19.327  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[16]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    196.951  mm,	Z =     20.449  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[17]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    195.901  mm,	Z =     21.521  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[18]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    194.799  mm,	Z =     22.538  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[19]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    193.648  mm,	Z =     23.500  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[20]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    192.450  mm,	Z =     24.402  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[21]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    191.209  mm,	Z =     25.244  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[22]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    189.927  mm,	Z =     26.023  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[23]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    188.608  mm,	Z =     26.736  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[24]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    187.255  mm,	Z =     27.383  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[25]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    185.871  mm,	Z =     27.961  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[26]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    184.460  mm,	Z =     28.470  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[27]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    183.025  mm,	Z =     28.907  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[28]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    181.570  mm,	Z =     29.272  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[29]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    180.099  mm,	Z =     29.563  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[30]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    178.615  mm,	Z =     29.781  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[31]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    177.122  mm,	Z =     29.925  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[32]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    175.624  mm,	Z =     29.994  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[33]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    174.124  mm,	Z =     29.987  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[34]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    172.626  mm,	Z =     29.906  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[35]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    171.135  mm,	Z =     29.750  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[36]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    169.653  mm,	Z =     29.520  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[37]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    168.184  mm,	Z =     29.215  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[38]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    166.732  mm,	Z =     28.838  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[39]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    165.301  mm,	Z =     28.389  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[40]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    163.895  mm,	Z =     27.869  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[41]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    162.516  mm,	Z =     27.279  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[42]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    161.168  mm,	Z =     26.621  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[43]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    159.855  mm,	Z =     25.896  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[44]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    158.579  mm,	Z =     25.107  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[45]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    157.345  mm,	Z =     24.255  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[46]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    156.155  mm,	Z =     23.342  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[47]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    155.012  mm,	Z =     22.371  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[48]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    153.919  mm,	Z =     21.344  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[49]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    152.878  mm,	Z =     20.264  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[50]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    151.893  mm,	Z =     19.133  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[51]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    150.966  mm,	Z =     17.954  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[52]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    150.098  mm,	Z =     16.731  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[53]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    149.293  mm,	Z =     15.465  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[54]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    148.553  mm,	Z =     14.161  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[55]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    147.878  mm,	Z =     12.821  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[56]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    147.271  mm,	Z =     11.450  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[57]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    146.733  mm,	Z =     10.050  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[58]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    146.266  mm,	Z =      8.624  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[59]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.871  mm,	Z =      7.177  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[60]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.549  mm,	Z =      5.713  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[61]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.300  mm,	Z =      4.234  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[62]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.126  mm,	Z =      2.744  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[63]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.026  mm,	Z =      1.247  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[64]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.001  mm,	Z =     -0.252  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[65]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.051  mm,	Z =     -1.751  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[66]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.176  mm,	Z =     -3.246  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[67]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.376  mm,	Z =     -4.732  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[68]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.649  mm,	Z =     -6.207  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[69]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.996  mm,	Z =     -7.666  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[70]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    146.415  mm,	Z =     -9.106  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[71]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    146.906  mm,	Z =    -10.523  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[72]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    147.467  mm,	Z =    -11.914  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[73]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    148.097  mm,	Z =    -13.276  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[74]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    148.794  mm,	Z =    -14.604  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[75]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    149.557  mm,	Z =    -15.895  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[76]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    150.383  mm,	Z =    -17.147  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[77]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    151.271  mm,	Z =    -18.356  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[78]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    152.218  mm,	Z =    -19.519  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[79]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    153.222  mm,	Z =    -20.633  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[80]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    154.280  mm,	Z =    -21.696  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[81]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    155.391  mm,	Z =    -22.704  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[82]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    156.550  mm,	Z =    -23.656  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[83]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    157.755  mm,	Z =    -24.548  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[84]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    159.004  mm,	Z =    -25.380  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[85]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    160.292  mm,	Z =    -26.147  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[86]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    161.617  mm,	Z =    -26.850  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[87]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    162.976  mm,	Z =    -27.485  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[88]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    164.365  mm,	Z =    -28.052  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[89]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    165.780  mm,	Z =    -28.548  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[90]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    167.218  mm,	Z =    -28.973  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[91]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    168.676  mm,	Z =    -29.326  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[92]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    170.150  mm,	Z =    -29.605  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[93]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    171.635  mm,	Z =    -29.811  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[94]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    173.130  mm,	Z =    -29.942  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[95]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    174.628  mm,	Z =    -29.998  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[96]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    176.128  mm,	Z =    -29.979  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[97]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    177.625  mm,	Z =    -29.885  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[98]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    179.115  mm,	Z =    -29.716  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[99]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    180.595  mm,	Z =    -29.474  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[100]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    182.061  mm,	Z =    -29.157  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[101]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    183.510  mm,	Z =    -28.768  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[102]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    184.937  mm,	Z =    -28.306  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[103]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    186.339  mm,	Z =    -27.774  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[104]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    187.713  mm,	Z =    -27.173  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[105]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    189.056  mm,	Z =    -26.504  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[106]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    190.363  mm,	Z =    -25.768  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[107]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    191.631  mm,	Z =    -24.968  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[108]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    192.858  mm,	Z =    -24.106  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[109]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    194.041  mm,	Z =    -23.183  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[110]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    195.176  mm,	Z =    -22.202  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[111]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    196.260  mm,	Z =    -21.166  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[112]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    197.291  mm,	Z =    -20.077  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[113]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    198.267  mm,	Z =    -18.938  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[114]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    199.184  mm,	Z =    -17.751  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[115]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    200.041  mm,	Z =    -16.521  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[116]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    200.836  mm,	Z =    -15.248  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[117]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    201.566  mm,	Z =    -13.938  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[118]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    202.229  mm,	Z =    -12.593  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[119]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    202.824  mm,	Z =    -11.216  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[120]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    203.350  mm,	Z =     -9.812  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[121]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    203.805  mm,	Z =     -8.382  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[122]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.188  mm,	Z =     -6.932  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[123]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.498  mm,	Z =     -5.465  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[124]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.734  mm,	Z =     -3.984  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[125]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.896  mm,	Z =     -2.493  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[126]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.983  mm,	Z =     -0.995  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[127]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.996  mm,	Z =      0.504  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[128]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.933  mm,	Z =      2.003  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[129]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.796  mm,	Z =      3.496  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[130]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.584  mm,	Z =      4.981  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[131]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    204.298  mm,	Z =      6.454  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[132]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    203.938  mm,	Z =      7.910  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[133]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    203.507  mm,	Z =      9.346  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[134]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    203.004  mm,	Z =     10.759  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[135]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    202.431  mm,	Z =     12.145  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[136]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    201.790  mm,	Z =     13.501  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[137]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    201.082  mm,	Z =     14.823  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[138]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    200.308  mm,	Z =     16.108  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[139]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    199.472  mm,	Z =     17.353  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[140]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    198.574  mm,	Z =     18.555  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[141]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    197.617  mm,	Z =     19.710  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[142]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    196.604  mm,	Z =     20.815  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[143]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    195.536  mm,	Z =     21.869  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[144]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    194.418  mm,	Z =     22.868  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[145]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    193.251  mm,	Z =     23.810  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[146]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    192.038  mm,	Z =     24.692  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[147]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    190.782  mm,	Z =     25.513  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[148]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    189.487  mm,	Z =     26.270  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[149]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    188.156  mm,	Z =     26.961  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[150]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    186.792  mm,	Z =     27.585  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[151]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    185.399  mm,	Z =     28.140  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[152]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    183.980  mm,	Z =     28.625  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[153]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    182.538  mm,	Z =     29.038  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[154]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    181.077  mm,	Z =     29.378  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[155]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    179.601  mm,	Z =     29.645  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[156]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    178.114  mm,	Z =     29.838  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[157]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    176.619  mm,	Z =     29.956  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[158]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    175.119  mm,	Z =     30.000  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[159]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    173.620  mm,	Z =     29.968  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[160]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    172.124  mm,	Z =     29.862  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[161]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    170.635  mm,	Z =     29.681  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[162]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    169.157  mm,	Z =     29.425  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[163]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    167.694  mm,	Z =     29.097  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[164]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    166.249  mm,	Z =     28.695  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[165]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    164.825  mm,	Z =     28.222  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[166]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    163.428  mm,	Z =     27.678  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[167]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    162.059  mm,	Z =     27.065  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[168]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    160.722  mm,	Z =     26.385  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[169]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    159.421  mm,	Z =     25.638  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[170]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    158.159  mm,	Z =     24.827  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[171]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    156.940  mm,	Z =     23.955  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[172]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    155.765  mm,	Z =     23.022  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[173]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    154.638  mm,	Z =     22.032  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[174]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    153.563  mm,	Z =     20.987  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[175]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    152.541  mm,	Z =     19.889  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[176]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    151.575  mm,	Z =     18.742  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[177]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    150.667  mm,	Z =     17.548  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[178]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    149.821  mm,	Z =     16.309  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[179]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    149.037  mm,	Z =     15.031  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[180]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    148.318  mm,	Z =     13.714  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[181]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    147.666  mm,	Z =     12.364  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[182]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    147.082  mm,	Z =     10.982  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[183]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    146.568  mm,	Z =      9.573  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[184]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    146.125  mm,	Z =      8.140  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[185]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.755  mm,	Z =      6.687  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[186]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.457  mm,	Z =      5.217  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[187]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.233  mm,	Z =      3.734  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[188]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.084  mm,	Z =      2.241  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[189]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.009  mm,	Z =      0.743  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[190]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.010  mm,	Z =     -0.757  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[191]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.085  mm,	Z =     -2.255  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[192]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.235  mm,	Z =     -3.747  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[193]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.459  mm,	Z =     -5.230  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[194]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    145.758  mm,	Z =     -6.700  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[195]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    146.129  mm,	Z =     -8.153  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[196]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    146.573  mm,	Z =     -9.586  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[197]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    147.087  mm,	Z =    -10.994  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[198]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    147.672  mm,	Z =    -12.376  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[199]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    148.324  mm,	Z =    -13.726  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[200]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    149.044  mm,	Z =    -15.042  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
/END
